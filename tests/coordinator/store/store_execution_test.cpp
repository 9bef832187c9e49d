#include <gtest/gtest.h>

#include "tests/coordinator/store/store_fixture.hpp"

namespace proofmass::coordinator {
namespace {

using test::delivery_of;
using test::lost_runs;
using test::session_1;

/// A campaign whose workers, results and losses are known.
class StoreExecution : public test::StoreTest {
 protected:
  static constexpr wire::SessionId second_worker{2}, third_worker{3};

  StoreExecution() : store(Store::create(file(), test::campaign_of(100), "definition")) {
    const auto worker = [](wire::SessionId session, const std::string& host) {
      return WorkerJoined{.session = session, .name = "w", .host = host};
    };
    write({worker(session_1, "node-1"), worker(second_worker, "node-1"),
           worker(third_worker, "node-2")});
  }
  void write(const std::vector<Entry>& entries) { (void)store.write(entries); }

  static Delivery computed(std::uint64_t run, wire::SessionId worker, std::uint32_t attempt,
                           double compute_s) {
    Delivery delivery = delivery_of(run);
    delivery.worker = worker;
    delivery.attempt = {attempt};
    delivery.compute_s = compute_s;
    return delivery;
  }

  Store store;
};

TEST_F(StoreExecution, OfANewCampaignIsEmpty) {
  const Execution execution =
      Store::create(directory() / "new.db", test::campaign_of(5), "definition").execution();
  EXPECT_EQ(execution.num_workers, 0U);
  EXPECT_EQ(execution.compute_s, 0.0);
  EXPECT_TRUE(execution.hosts.empty());
  EXPECT_TRUE(execution.losses.empty());
  EXPECT_FALSE(execution.first_result_utc.has_value());
}

TEST_F(StoreExecution, SharesTheTimeAmongHosts) {
  write({computed(0, session_1, 1, 0.5), computed(1, second_worker, 1, 1.0),
         computed(2, second_worker, 2, 2.0), computed(3, third_worker, 3, 4.0)});
  store.begin_coordinator({.epoch = {1}, .host = "login", .process_id = 7, .version = "v"});
  store.begin_coordinator({.epoch = {2}, .host = "login", .process_id = 8, .version = "v"});
  const Execution execution = store.execution();
  EXPECT_EQ(execution.num_coordinators, 2U);
  EXPECT_EQ(execution.num_workers, 3U);
  EXPECT_EQ(execution.num_hosts, 2U);
  EXPECT_EQ(execution.compute_s, 7.5);
  EXPECT_EQ(execution.num_retried, 2U);
  ASSERT_EQ(execution.hosts.size(), 2U);
  EXPECT_EQ(execution.hosts[0].host, "node-1");
  EXPECT_EQ(execution.hosts[0].num_workers, 2U);
  EXPECT_EQ(execution.hosts[0].num_results, 3U);
  EXPECT_EQ(execution.hosts[0].compute_s, 3.5);
  EXPECT_EQ(execution.hosts[1].host, "node-2");
  EXPECT_EQ(execution.hosts[1].compute_s, 4.0);
}

TEST_F(StoreExecution, CountsLossesByReasonAndBlame) {
  write({lost_runs(0, 10, wire::LossReason::silent, false),
         lost_runs(10, 5, wire::LossReason::silent, false),
         lost_runs(20, 1, wire::LossReason::crashed, true),
         lost_runs(21, 2, wire::LossReason::crashed, false)});
  const std::vector<LossShare> losses = store.execution().losses;
  ASSERT_EQ(losses.size(), 3U);
  EXPECT_EQ(losses[0].reason, "silent");
  EXPECT_EQ(losses[0].num_losses, 2U);
  EXPECT_EQ(losses[0].num_runs, 15U);
  EXPECT_FALSE(losses[0].is_blamed);
  EXPECT_EQ(losses[1].num_runs, 2U);
  EXPECT_FALSE(losses[1].is_blamed);
  EXPECT_EQ(losses[2].num_runs, 1U);
  EXPECT_TRUE(losses[2].is_blamed);
}

TEST_F(StoreExecution, CountsSecondResultsAndThoseThatDiffer) {
  write({computed(0, session_1, 1, 0.5), computed(1, session_1, 1, 0.5)});
  Delivery wrong = test::wrong_delivery_of(1);
  wrong.worker = third_worker;
  write({SecondDelivery{computed(0, third_worker, 1, 0.5)}, SecondDelivery{wrong}});
  const Execution execution = store.execution();
  EXPECT_EQ(execution.num_audited, 2U);
  EXPECT_EQ(execution.num_contradicting, 1U);
}

TEST_F(StoreExecution, KnowsTheFirstAndTheLastResult) {
  write({computed(0, session_1, 1, 0.5), computed(1, session_1, 1, 0.5),
         computed(2, session_1, 1, 0.5)});
  test::change(file(), "UPDATE delivery SET received_unix_s = 86400 + 3600 * run_index");
  const Execution execution = store.execution();
  EXPECT_EQ(execution.first_result_utc, "1970-01-02T00:00:00Z");
  EXPECT_EQ(execution.last_result_utc, "1970-01-02T02:00:00Z");
}

}  // namespace
}  // namespace proofmass::coordinator
