#include "coordinator/cli/stop_signals.hpp"

#include <gtest/gtest.h>
#include <poll.h>
#include <signal.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <csignal>
#include <thread>

namespace proofmass::coordinator {
namespace {

constexpr int timeout_ms = 100;

std::atomic<int> num_handled = 0;
std::atomic<bool> is_handled_here = false;
thread_local bool is_this_thread = false;

class SignalThreadTest : public testing::Test {
 protected:
  void SetUp() override {
    num_handled = 0;
    is_handled_here = false;
    is_this_thread = true;
    for (const int number : {SIGINT, SIGTERM}) {
      (void)std::signal(number, [](int) {
        ++num_handled;
        if (is_this_thread) is_handled_here = true;
      });
    }
  }
  void TearDown() override {
    for (const int number : {SIGINT, SIGTERM}) (void)std::signal(number, SIG_DFL);
  }

  /// Waits until the time is over while signals come: 0, or the error that ended it.
  static int error_of_waiting() {
    std::atomic<bool> is_over = false;
    std::thread sender([&] {
      while (!is_over) {
        const int num_before = num_handled;
        kill(getpid(), num_before % 2 == 0 ? SIGTERM : SIGINT);
        while (num_handled == num_before && !is_over) std::this_thread::yield();
      }
    });
    const int error = poll(nullptr, 0, timeout_ms) == 0 ? 0 : errno;
    is_over = true;
    sender.join();
    return error;
  }
};

TEST_F(SignalThreadTest, LetsNoSignalInterruptACall) {
  const SignalThread signals;
  EXPECT_EQ(error_of_waiting(), 0);
  EXPECT_GT(num_handled, 1);
  EXPECT_FALSE(is_handled_here);
}

TEST_F(SignalThreadTest, LeavesSignalsAsTheyWere) {
  { const SignalThread signals; }
  raise(SIGTERM);
  EXPECT_TRUE(is_handled_here);
}

/// Ends this process with the request that a signal leads to, where SIGHUP was handled so before.
[[noreturn]] void exit_with_request_after(int signal, void (*former_handler)(int)) {
  (void)std::signal(SIGHUP, former_handler);
  const std::atomic<StopRequest>& request = catch_stop_signals(OnTerminate::drain);
  (void)raise(signal);
  _exit(static_cast<int>(request.load()));
}

testing::ExitedWithCode ends_with(StopRequest request) {
  return testing::ExitedWithCode(static_cast<int>(request));
}

TEST(StopSignalsDeathTest, LeaveTheWorkersOnAHangUp) {
  EXPECT_EXIT(exit_with_request_after(SIGHUP, SIG_DFL), ends_with(StopRequest::leave), "");
  EXPECT_EXIT(exit_with_request_after(SIGTERM, SIG_DFL), ends_with(StopRequest::drain), "");
}

// As `nohup` does.
TEST(StopSignalsDeathTest, LeaveAHangUpIgnoredThatWasIgnoredBefore) {
  EXPECT_EXIT(exit_with_request_after(SIGHUP, SIG_IGN), ends_with(StopRequest::none), "");
}

}  // namespace
}  // namespace proofmass::coordinator
