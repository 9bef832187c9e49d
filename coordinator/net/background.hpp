#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace proofmass::coordinator {

/// A thread for what takes long: reading large requests, making and opening campaign files. One
/// thing at a time, in the order in which they were handed over.
class Background {
 public:
  /// What is to be done in the service's thread with what a task came to. May throw.
  using Finish = std::function<void()>;
  /// Done in the background thread. Must not throw.
  using Task = std::function<Finish()>;

  static constexpr std::size_t num_tasks_max = 16;  ///< That wait or are under way.

  /// @param wake  Called in the background thread when a task is done. Must not throw.
  explicit Background(std::function<void()> wake);
  ~Background();  ///< Waits for the task that is under way; those that wait are dropped.
  Background(const Background&) = delete;
  Background& operator=(const Background&) = delete;

  /// False if there are too many tasks.
  [[nodiscard]] bool post(Task task);
  /// Hands over a task however many there are: for the next step of one that was accepted.
  void post_next(Task task);

  /// Of the tasks that are done, in order.
  [[nodiscard]] std::vector<Finish> take_finished();

  /// True if no task waits, is under way, or is done and has not been taken.
  [[nodiscard]] bool is_idle();

  /// Waits until all tasks are done.
  void wait();

 private:
  void run();

  const std::function<void()> wake_;
  std::mutex mutex_;  ///< Guards all that follows.
  std::condition_variable changed_;
  std::deque<Task> tasks_;  ///< The first of them is under way.
  std::vector<Finish> finished_;
  bool is_ending_ = false;
  std::thread thread_;  ///< Begins when all else is there.
};

}  // namespace proofmass::coordinator
