#include "coordinator/store/campaign_history.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include "tests/coordinator/store/store_fixture.hpp"

namespace proofmass::coordinator {
namespace {

using test::delivery_of;
using test::lost_runs;
using test::result_of;
using test::session_1;
using ::testing::ElementsAre;

class CampaignHistoryTest : public test::StoreTest {
 protected:
  CampaignHistoryTest() : store(create(100)) { write({test::worker_1()}); }
  void write(const std::vector<Entry>& entries) { (void)store.write(entries); }

  static Delivery failed(std::uint64_t run, RunStatus status) {
    Delivery delivery = delivery_of(run);
    delivery.result = result_of(run, status);
    return delivery;
  }

  Store store;
};

TEST_F(CampaignHistoryTest, HasTheEventsAfterOne) {
  for (int i = 0; i < 5; ++i) store.record_event("event", fmt::format("number {}", i));
  const CampaignHistory history(file());
  const std::vector<StoredEvent> all = history.events_after(0, 100);
  ASSERT_EQ(all.size(), 5U);
  EXPECT_EQ(all[0].text, "number 0");
  EXPECT_EQ(all[4].kind, "event");
  const std::vector<StoredEvent> some = history.events_after(all[2].id, 100);
  ASSERT_EQ(some.size(), 2U);
  EXPECT_EQ(some[0].text, "number 3");
  // The newest ones if there are too many.
  EXPECT_EQ(history.events_after(0, 2)[0].text, "number 3");
  store.record_event("event", "later");
  EXPECT_EQ(history.events_after(all[4].id, 100)[0].text, "later");
}

TEST_F(CampaignHistoryTest, CountsLossesByReasonAndBlame) {
  write({lost_runs(0, 10, wire::LossReason::silent, false),
         lost_runs(10, 5, wire::LossReason::silent, false),
         lost_runs(20, 1, wire::LossReason::crashed, true),
         lost_runs(21, 2, wire::LossReason::crashed, false)});
  const std::vector<LossCount> by_reason = CampaignHistory(file()).losses();
  const auto has = [](const LossCount& loss, std::string_view reason, std::uint64_t num_losses,
                      std::uint64_t num_runs, std::uint64_t num_blamed) {
    return loss.reason == reason && loss.num_losses == num_losses && loss.num_runs == num_runs &&
           loss.num_blamed == num_blamed;
  };
  ASSERT_EQ(by_reason.size(), 2U);
  EXPECT_TRUE(has(by_reason[0], "silent", 2, 15, 0));
  EXPECT_TRUE(has(by_reason[1], "crashed", 2, 3, 1));
  std::string shares;
  for (const LossShare& loss : store.execution().losses) {
    shares += fmt::format("{} {} {} {};", loss.reason, loss.num_losses, loss.num_runs,
                          loss.is_blamed ? "blamed" : "not");
  }
  EXPECT_EQ(shares, "silent 2 15 not;crashed 1 2 not;crashed 1 1 blamed;");
}

TEST_F(CampaignHistoryTest, CountsHowRunsEndedWithoutAnEstimate) {
  write({delivery_of(0), failed(1, RunStatus::not_converged), failed(2, RunStatus::not_finite),
         failed(3, RunStatus::no_draw), failed(4, RunStatus::no_draw)});
  const std::vector<EndCount> ends = CampaignHistory(file()).ends_without_estimate();
  ASSERT_EQ(ends.size(), 3U);
  EXPECT_EQ(ends[0].status, "no draw");
  EXPECT_EQ(ends[0].num_runs, 2U);
  EXPECT_EQ(ends[1].status, "not converged");
  EXPECT_EQ(ends[2].status, "not finite");
  EXPECT_EQ(ends[2].num_runs, 1U);
  EXPECT_EQ(ends[2].cause, "");
}

TEST_F(CampaignHistoryTest, NamesRunsThatWereGivenUp) {
  for (const std::uint64_t run : {7U, 3U, 5U}) {
    write({lost_runs(run, 1, wire::LossReason::crashed, true), GivenUpRun{{run}}});
  }
  const std::vector<GivenUpRecord> runs = CampaignHistory(file()).given_up(2);
  ASSERT_EQ(runs.size(), 2U);
  EXPECT_EQ(runs[0].run.value, 3U);
  EXPECT_EQ(runs[1].run.value, 5U);
  EXPECT_EQ(runs[0].reason, "crashed");
  EXPECT_EQ(runs[0].num_attempts, 1U);
}

// Three runs of one batch share its time; a fourth one was computed by itself.
TEST_F(CampaignHistoryTest, JoinsTheRunsOfABatch) {
  std::vector<Entry> entries;
  for (const std::uint64_t run : {4U, 5U, 6U}) entries.emplace_back(delivery_of(run));
  Delivery single = delivery_of(9);
  single.compute_s = 2.0;
  entries.emplace_back(single);
  write(entries);
  change("UPDATE delivery SET received_unix_s = 2000");
  const RecentAttempts attempts = CampaignHistory(file()).recent_attempts(100, 100);
  ASSERT_EQ(attempts.computed.size(), 2U);
  EXPECT_THAT(attempts.computed[0].runs, ElementsAre(RunIndex{4}, RunIndex{5}, RunIndex{6}));
  EXPECT_DOUBLE_EQ(attempts.computed[0].compute_s, 1.5);
  EXPECT_EQ(attempts.computed[0].received_unix_s, 2000U);
  EXPECT_THAT(attempts.computed[1].runs, ElementsAre(RunIndex{9}));
  ASSERT_EQ(attempts.workers.size(), 1U);
  EXPECT_EQ(attempts.workers[0].name, "worker-1");
  EXPECT_EQ(attempts.workers[0].host, "node-1");
}

TEST_F(CampaignHistoryTest, HasTheNewestAttemptsAndCountsTheOthers) {
  std::vector<Entry> entries;
  for (std::uint64_t run = 0; run < 20; ++run) entries.emplace_back(delivery_of(run));
  for (std::uint64_t i = 0; i < 5; ++i) {
    entries.emplace_back(lost_runs(50 + i, 1, wire::LossReason::silent, false));
  }
  write(entries);
  change("UPDATE delivery SET received_unix_s = 1000 + run_index");
  const RecentAttempts attempts = CampaignHistory(file()).recent_attempts(8, 2);
  EXPECT_EQ(attempts.num_runs_left_out, 12U);
  EXPECT_EQ(attempts.num_losses_left_out, 3U);
  ASSERT_EQ(attempts.computed.size(), 8U);
  EXPECT_EQ(attempts.computed.front().runs.front().value, 19U);
  EXPECT_EQ(attempts.computed.back().runs.front().value, 12U);
  ASSERT_EQ(attempts.lost.size(), 2U);
  EXPECT_EQ(attempts.lost[0].runs.first.value, 54U);
}

/// A campaign whose workers, results and losses are known.
class StoreExecution : public test::StoreTest {
 protected:
  static constexpr wire::SessionId second_worker{2}, third_worker{3};

  StoreExecution() : store(create(100)) {
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

TEST_F(StoreExecution, SaysWhoComputedTheResultsAndWhen) {
  write({computed(0, session_1, 1, 0.5), computed(1, second_worker, 1, 1.0),
         computed(2, second_worker, 2, 2.0), computed(3, third_worker, 3, 4.0)});
  store.begin_coordinator({.epoch = {1}, .host = "login", .process_id = 7, .version = "v"});
  store.begin_coordinator({.epoch = {2}, .host = "login", .process_id = 8, .version = "v"});
  Delivery wrong = test::wrong_delivery_of(1);
  wrong.worker = third_worker;
  write({SecondDelivery{computed(0, third_worker, 1, 0.5)}, SecondDelivery{wrong}});
  test::change(file(), "UPDATE delivery SET received_unix_s = 86400 + 3600 * run_index");
  const Execution execution = store.execution();
  EXPECT_EQ(execution.num_audited, 2U);
  EXPECT_EQ(execution.num_contradicting, 1U);
  EXPECT_EQ(execution.first_result_utc, "1970-01-02T00:00:00Z");
  EXPECT_EQ(execution.last_result_utc, "1970-01-02T03:00:00Z");
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

}  // namespace
}  // namespace proofmass::coordinator
