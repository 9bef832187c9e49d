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

bool Background::post(Task task) {
  {
    const std::lock_guard lock(mutex_);
    if (tasks_.size() >= num_tasks_max) return false;
    tasks_.push_back(std::move(task));
  }
  changed_.notify_all();
  return true;
}

void Background::post_next(Task task) {
  {
    const std::lock_guard lock(mutex_);
    tasks_.push_back(std::move(task));
  }
  changed_.notify_all();
}

std::vector<Background::Finish> Background::take_finished() {
  const std::lock_guard lock(mutex_);
  return std::exchange(finished_, {});
}

bool Background::is_idle() {
  const std::lock_guard lock(mutex_);
  return tasks_.empty() && finished_.empty();
}

void Background::wait() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return tasks_.empty(); });
}

void Background::run() {
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [this] { return is_ending_ || !tasks_.empty(); });
    if (is_ending_) return;
    Task task = std::move(tasks_.front());
    lock.unlock();
    Finish finish = task();
    task = nullptr;  // What it holds may be large, and is freed here.
    lock.lock();
    tasks_.pop_front();
    finished_.push_back(std::move(finish));
    lock.unlock();
    changed_.notify_all();
    wake_();
    lock.lock();
  }
}

}  // namespace proofmass::coordinator
