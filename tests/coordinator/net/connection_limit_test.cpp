#include "coordinator/net/connection_limit.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <chrono>
#include <string>
#include <vector>
#include <zmq.hpp>

#include "proto/link/socket.hpp"
#include "tests/coordinator/cli/temporary_directory.hpp"

namespace proofmass::coordinator {
namespace {

using Clock = std::chrono::steady_clock;

TEST(DescriptorLimit, BecomesWhatTheSystemAllows) {
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_NOFILE, &before), 0);
  ASSERT_GT(before.rlim_max, 256U);
  const rlimit low{.rlim_cur = 256, .rlim_max = before.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &low), 0);

  EXPECT_EQ(raise_descriptor_limit(), before.rlim_max);

  rlimit after{};
  ASSERT_EQ(getrlimit(RLIMIT_NOFILE, &after), 0);
  EXPECT_EQ(after.rlim_cur, before.rlim_max);
  setrlimit(RLIMIT_NOFILE, &before);
}

TEST(ConnectionLimit, KeepsDescriptorsForFilesAndClients) {
  const ConnectionLimit large = connection_limit(4096, 20, "ipc:///c");
  EXPECT_EQ(large.workers_end, 4096 - 128);
  EXPECT_EQ(large.clients_end, 4096 - 64);
  EXPECT_EQ(large.num_workers_max, 4096 - 128 - 20);
  const ConnectionLimit small = connection_limit(64, 20, "ipc:///c");
  EXPECT_EQ(small.workers_end, 48);
  EXPECT_EQ(small.clients_end, 56);
  EXPECT_EQ(small.num_workers_max, 28);
  EXPECT_EQ(connection_limit(16, 20, "").num_workers_max, 0);
  EXPECT_GT(connection_limit(~std::uint64_t{0}, 20, "").num_workers_max, 1'000'000'000);
}

TEST(RefusedConnections, AreNewsOnceUntilAPause) {
  RefusedConnections refused;
  const auto start = Clock::now();
  const auto at = [&](int minute) { return start + std::chrono::minutes(minute); };
  EXPECT_FALSE(refused.is_news(0, at(0)));
  EXPECT_TRUE(refused.is_news(3, at(1)));
  EXPECT_FALSE(refused.is_news(9, at(5)));
  EXPECT_FALSE(refused.is_news(10, at(9)));
  EXPECT_FALSE(refused.is_news(10, at(20)));
  EXPECT_TRUE(refused.is_news(11, at(21)));
}

/// Sockets of workers and clients, and peers that connect to them.
class LimitedConnections : public testing::TestWithParam<std::string> {
 protected:
  ~LimitedConnections() override { limit_connections({}); }

  zmq::socket_t connected(const zmq::socket_t& router) {
    zmq::socket_t dealer = wire::make_dealer(peers_context, {});
    dealer.set(zmq::sockopt::linger, 0);
    dealer.connect(router.get(zmq::sockopt::last_endpoint));
    return dealer;
  }
  static bool is_connected(zmq::socket_t& dealer) {
    std::vector<zmq::pollitem_t> items{{dealer.handle(), 0, ZMQ_POLLOUT, 0}};
    return zmq::poll(items, std::chrono::seconds(20)) == 1;
  }
  static void wait_for_refusals(std::uint64_t count) {
    const auto deadline = Clock::now() + std::chrono::seconds(20);
    while (num_connections_refused() < count && Clock::now() < deadline) {
    }
    ASSERT_GE(num_connections_refused(), count);
  }

  test::TemporaryDirectory directory;
  zmq::context_t context;
  zmq::context_t peers_context;
};

TEST_P(LimitedConnections, AreMadeByClientsWhenWorkersHaveUsedUpTheirs) {
  const auto endpoint = [&](const std::string& name) {
    return GetParam() == "tcp" ? "tcp://127.0.0.1:*" : "ipc://" + (directory / name).string();
  };
  const zmq::socket_t workers = wire::make_router(context, "bind", endpoint("workers"), {});
  const zmq::socket_t clients = wire::make_router(context, "bind", endpoint("clients"), {});
  zmq::socket_t worker = connected(workers);
  ASSERT_TRUE(is_connected(worker));
  const std::uint64_t num_refused = num_connections_refused();

  ConnectionLimit limit{.workers_end = 3};
  limit.clients_endpoint = clients.get(zmq::sockopt::last_endpoint);
  limit_connections(limit);
  zmq::socket_t waiting = connected(workers);
  wait_for_refusals(num_refused + 3);  // It tries again.
  zmq::socket_t client = connected(clients);
  EXPECT_TRUE(is_connected(client));
  EXPECT_TRUE(is_connected(worker));

  limit_connections({});
  EXPECT_TRUE(is_connected(waiting));
}

INSTANTIATE_TEST_SUITE_P(Transports, LimitedConnections, testing::Values("tcp", "ipc"));

}  // namespace
}  // namespace proofmass::coordinator
