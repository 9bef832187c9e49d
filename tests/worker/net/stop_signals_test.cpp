#include "worker/net/stop_signals.hpp"

#include <gtest/gtest.h>
#include <poll.h>
#include <signal.h>

#include "worker/supervision/supervisor.hpp"

namespace proofmass::worker {
namespace {

bool is_readable(const StopSignals& signals) {
  pollfd item{.fd = signals.descriptor(), .events = POLLIN, .revents = 0};
  return poll(&item, 1, 0) == 1;
}

/// As the supervisor does.
void hand_on(int num_requests) {
  pthread_sigqueue(pthread_self(), handed_on_signal(), {.sival_int = num_requests});
}

TEST(StopSignals, DrainAtFirstAndEndAtOnceThen) {
  StopSignals signals(SignalSource::anyone);
  EXPECT_EQ(signals.request(), StopRequest::none);
  EXPECT_FALSE(is_readable(signals));
  raise(SIGTERM);
  EXPECT_TRUE(is_readable(signals));
  EXPECT_EQ(signals.request(), StopRequest::drain);
  EXPECT_FALSE(is_readable(signals));
  EXPECT_EQ(signals.request(), StopRequest::drain);
  raise(SIGINT);
  EXPECT_EQ(signals.request(), StopRequest::abandon);
}

TEST(StopSignals, CountInterrupts) {
  StopSignals signals(SignalSource::anyone);
  raise(SIGINT);
  EXPECT_EQ(signals.request(), StopRequest::drain);
  raise(SIGINT);
  EXPECT_EQ(signals.request(), StopRequest::abandon);
}

// SIGTERM to both processes, once or twice, is one request as long as the supervisor has one.
TEST(StopSignals, AreCountedByTheSupervisor) {
  StopSignals signals(SignalSource::supervisor);
  raise(SIGTERM);
  EXPECT_EQ(signals.request(), StopRequest::drain);
  hand_on(1);
  EXPECT_EQ(signals.request(), StopRequest::drain);
  raise(SIGINT);
  EXPECT_EQ(signals.request(), StopRequest::drain);
  hand_on(2);
  EXPECT_EQ(signals.request(), StopRequest::abandon);
  raise(SIGTERM);
  EXPECT_EQ(signals.request(), StopRequest::abandon);
}

TEST(StopSignals, EndAtOnceIfTheyComeFromTheCampaign) {
  StopSignals signals(SignalSource::campaign);
  raise(SIGINT);
  EXPECT_EQ(signals.request(), StopRequest::none);
  raise(SIGTERM);
  EXPECT_EQ(signals.request(), StopRequest::abandon);
}

}  // namespace
}  // namespace proofmass::worker
