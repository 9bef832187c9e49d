// A coordinator that may have few descriptors open, and peers that take as many as they can.

#include <gtest/gtest.h>
#include <signal.h>

#include <memory>
#include <regex>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/proto/link/raw_peer.hpp"
#include "tests/system/fault_fixture.hpp"

namespace proofmass::test {
namespace {

using FewDescriptors = FaultTest;

TEST_F(FewDescriptors, ServeAsManyWorkersAsThereIsRoomForAndAllClients) {
  Process coordinator =
      this->coordinator("coordinator", {"null.toml"}, {"prlimit", "--nofile=256:256"});
  wait_for_log("coordinator", "few_descriptors limit=256 workers_max=");
  std::smatch found;
  const std::string log = errors_of("coordinator");
  ASSERT_TRUE(std::regex_search(log, found, std::regex("workers_max=(\\d+)")));
  const std::size_t num_workers_max = std::stoul(found[1]);
  EXPECT_GT(num_workers_max, 140U);
  Process swarm =
      start_behind({}, "swarm", "proofmass-swarm",
                   {"--connect", workers_endpoint, "--workers", "185", "--batch-time-s", "0.1"});
  wait_for_done("null", num_null_runs);
  EXPECT_EQ(status_of("null").at("num_done"), num_null_runs);
  EXPECT_LE(num_log_lines("coordinator", "worker_registered"), num_workers_max);
  EXPECT_EQ(num_log_lines("coordinator", "sockets_reset"), 0U) << errors_of("coordinator");
  swarm.signal(SIGKILL);
  EXPECT_EQ(swarm.wait(), -SIGKILL);
  coordinator.signal(SIGINT);
  EXPECT_EQ(coordinator.wait(), 130) << errors_of("coordinator");
}

// They hold far more connections than there are descriptors, and say nothing or fill a frame of the
// handshake, for as long as the campaign takes.
TEST_F(FewDescriptors, AreHadBackFromPeersWithoutKeys) {
  workers_endpoint = "tcp://127.0.0.1:*";
  clients_endpoint = "tcp://127.0.0.1:*";
  write_null_campaign(300);
  Process keygen = start_behind({}, "keygen", "proofmass", {"keygen", "keys"});
  ASSERT_EQ(keygen.wait(), 0) << errors_of("keygen");
  Process coordinator =
      this->coordinator("coordinator", {"null.toml", "--keys", "keys", "--memory-max", "512"},
                        {"prlimit", "--nofile=256:256"});
  wait_for_log("coordinator", "coordinator_started");
  std::smatch found;
  const std::string log = errors_of("coordinator");
  ASSERT_TRUE(std::regex_search(log, found, std::regex("bind=(\\S+) bind_clients=(\\S+)")));
  workers_endpoint = found[1];
  clients_endpoint = found[2];

  const Process worker = null_worker("worker", {"--keys", "keys", "--run-time", "0.05"});
  std::vector<std::unique_ptr<RawPeer>> peers;
  const auto flood = [&] {
    peers.clear();
    try {
      for (int i = 0; i < 600; ++i) {
        const std::string& endpoint = i % 2 == 0 ? workers_endpoint : clients_endpoint;
        peers.push_back(std::make_unique<RawPeer>(endpoint));
        if (i % 3 == 0) continue;
        peers.back()->greet(RawPeer::Mechanism::curve);
        if (i % 3 == 1) peers.back()->send(RawPeer::head_of_large(RawPeer::command, 1 << 20));
      }
    } catch (const std::runtime_error&) {  // Cut off.
    }
  };
  while (num_log_lines("coordinator", "campaign_finished") == 0) flood();
  EXPECT_GE(num_log_lines("coordinator", "descriptors were lacking"), 1U);
  coordinator.signal(SIGTERM);
  EXPECT_EQ(coordinator.wait(), 0) << errors_of("coordinator");
  EXPECT_EQ(digest("null"), undisturbed_digest("null"));
}

TEST_F(FewDescriptors, AreNotMentionedWhereThereAreEnough) {
  Process coordinator =
      this->coordinator("coordinator", {"null.toml"}, {"prlimit", "--nofile=4400:4400"});
  wait_for_log("coordinator", "coordinator_started");
  EXPECT_EQ(num_log_lines("coordinator", "few_descriptors"), 0U) << errors_of("coordinator");
}

}  // namespace
}  // namespace proofmass::test
