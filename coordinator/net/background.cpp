#include "coordinator/net/background.hpp"

#include <utility>

namespace proofmass::coordinator {

Background::Background(std::function<void()> wake)
    : wake_(std::move(wake)), thread_([this] { run(); }) {}

Background::~Background() {
  {
    const std::lock_guard lock(mutex_);
    is_ending_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

bool Background::post(Work work) {
  {
    const std::lock_guard lock(mutex_);
    if (pending_.size() >= num_pending_max) return false;
  }
  post_next(std::move(work));  // One thread posts: nobody has taken the place meanwhile.
  return true;
}

void Background::post_next(Work work) {
  {
    const std::lock_guard lock(mutex_);
    pending_.push_back(std::move(work));
  }
  changed_.notify_all();
}

std::vector<Background::Finish> Background::take_finished() {
  const std::lock_guard lock(mutex_);
  return std::exchange(finished_, {});
}

bool Background::is_idle() {
  const std::lock_guard lock(mutex_);
  return pending_.empty() && finished_.empty();
}

void Background::wait() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return pending_.empty(); });
}

void Background::run() {
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [this] { return is_ending_ || !pending_.empty(); });
    if (is_ending_) return;
    Work work = std::move(pending_.front());
    lock.unlock();
    Finish finish = work();
    work = nullptr;  // What it holds may be large, and is freed here.
    lock.lock();
    pending_.pop_front();
    finished_.push_back(std::move(finish));
    lock.unlock();
    changed_.notify_all();
    wake_();
    lock.lock();
  }
}

}  // namespace proofmass::coordinator
