#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <exception>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "proto/wire/client_codec.hpp"

namespace proofmass::coordinator {

/// Answers a request, now or later; called once, in the service's thread.
using Respond = std::function<void(proto::ReplyEnvelope)>;

/// Why an action throws; empty if it does not.
[[nodiscard]] inline std::string failure_of(const std::function<void()>& action) {
  try {
    action();
    return {};
  } catch (const std::exception& error) {
    return error.what();
  }
}

/// Lets an action respond; if it throws instead, responds with the reason: a client waits for as
/// long as its request is not answered.
inline void respond_or_say_why(const Respond& respond, const std::function<void()>& action) {
  try {
    action();
  } catch (const std::exception& error) {
    respond(wire::error_reply(error.what()));
  }
}

/// A thread for work that takes long: reading large requests, making and opening campaign
/// databases. It does one piece of work at a time, in the order in which they were posted.
class Background {
 public:
  /// What is to be done in the service's thread when some work is done. May throw.
  using Finish = std::function<void()>;
  /// Done in the background thread. Must not throw.
  using Work = std::function<Finish()>;

  static constexpr std::size_t num_pending_max = 16;  ///< That wait or are under way.

  /// @param wake  Called in the background thread when some work is done. Must not throw.
  explicit Background(std::function<void()> wake);
  ~Background();  ///< Waits for what is under way; what has not begun is dropped.

  /// False if too much work is pending.
  [[nodiscard]] bool post(Work work);
  /// Posts work however much is pending: for the next step of work that was accepted.
  void post_next(Work work);

  /// Of the work that is done, in order.
  [[nodiscard]] std::vector<Finish> take_finished();

  /// True if no work waits, is under way, or is done and has not been taken.
  [[nodiscard]] bool is_idle();

  /// Waits until all work is done.
  void wait();

 private:
  void run();

  const std::function<void()> wake_;
  std::mutex mutex_;  ///< Guards all that follows.
  std::condition_variable changed_;
  std::deque<Work> pending_;  ///< The first of them is under way.
  std::vector<Finish> finished_;
  bool is_ending_ = false;
  std::thread thread_;  ///< Begins when all else is there.
};

/// Work that may throw, and what is done with its result, a future that is ready.
template <typename Action, typename Then>
[[nodiscard]] Background::Work work_of(Action action, Then then) {
  // Shared, as functions that can be copied hold it.
  const auto shared = std::make_shared<Action>(std::move(action));
  return [shared, then = std::move(then)]() -> Background::Finish {
    auto result = std::async(std::launch::deferred, std::move(*shared));
    result.wait();  // Here it is done.
    const auto held = std::make_shared<decltype(result)>(std::move(result));
    return [held, then] { then(std::move(*held)); };
  };
}

}  // namespace proofmass::coordinator
