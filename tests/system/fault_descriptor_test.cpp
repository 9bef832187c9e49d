// A coordinator that may have fewer descriptors open than workers want to connect.

#include <gtest/gtest.h>
#include <signal.h>

#include <string>

#include "tests/system/fault_fixture.hpp"

namespace proofmass::test {
namespace {

using FewDescriptors = FaultTest;

TEST_F(FewDescriptors, ServeSomeWorkersAndAllClients) {
  Process coordinator =
      this->coordinator("coordinator", {"null.toml"}, {"prlimit", "--nofile=64:64"});
  wait_for_log("coordinator", "few_descriptors limit=64 workers_max=");
  Process swarm =
      start_behind({}, "swarm", "proofmass-swarm",
                   {"--connect", workers_endpoint, "--workers", "100", "--batch-time-s", "0.1"});
  wait_for_log("coordinator", "connections_refused");
  wait_for_done("null", num_null_runs);
  EXPECT_EQ(status_of("null").at("num_done"), num_null_runs);
  const std::size_t num_registered = num_log_lines("coordinator", "worker_registered");
  EXPECT_GE(num_registered, 10U);
  EXPECT_LT(num_registered, 64U);

  swarm.signal(SIGKILL);
  EXPECT_EQ(swarm.wait(), -SIGKILL);
  Process late = null_worker("late");
  wait_for_log("coordinator", "name=late ");
  EXPECT_EQ(num_log_lines("coordinator", "connections_refused"), 1U) << errors_of("coordinator");
  coordinator.signal(SIGINT);
  EXPECT_EQ(coordinator.wait(), 130) << errors_of("coordinator");
  EXPECT_EQ(late.wait(), 0) << errors_of("late");
}

TEST_F(FewDescriptors, AreNotMentionedWhereThereAreEnough) {
  Process coordinator =
      this->coordinator("coordinator", {"null.toml"}, {"prlimit", "--nofile=4400:4400"});
  wait_for_log("coordinator", "coordinator_started");
  EXPECT_EQ(num_log_lines("coordinator", "few_descriptors"), 0U) << errors_of("coordinator");
}

}  // namespace
}  // namespace proofmass::test
