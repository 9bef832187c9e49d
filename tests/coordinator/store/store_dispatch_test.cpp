// What a campaign database keeps for the next coordinator, and of workers, losses and second
// results.

#include "coordinator/store/store.hpp"
#include "tests/coordinator/store/store_fixture.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

using test::session_1;
using test::worker_1;
using test::write;

using StoreDispatch = test::StoreTest;

ReturnedRuns lost(std::uint64_t first, std::uint64_t count, std::uint32_t attempt,
                  wire::LossReason reason) {
  return {.runs = {RunIndex{first}, count},
          .attempt = {attempt},
          .worker = session_1,
          .reason = reason,
          .is_blamed = reason == wire::LossReason::crashed};
}

TEST_F(StoreDispatch, GivesEachFileANumberThatItKeeps) {
  const wire::CampaignId id = create().id();
  EXPECT_EQ(Store::open(file()).id(), id);
  EXPECT_EQ(Store::open_read_only(file()).id(), id);
  const Store other = Store::create(directory() / "other.db", campaign_of(10), "");
  EXPECT_NE(other.id(), id);
  EXPECT_GT(id.value, 0u);
  EXPECT_LT(id.value, std::uint64_t{1} << 63);
}

TEST_F(StoreDispatch, KeepsHowTheCampaignIsServed) {
  EXPECT_EQ(create().control(), CampaignControl{});
  for (const auto phase : {wire::CampaignPhase::paused, wire::CampaignPhase::finished,
                           wire::CampaignPhase::cancelled, wire::CampaignPhase::active}) {
    const CampaignControl control{.phase = phase, .priority = -7, .audit_fraction = 1.0 / 3.0};
    Store store = Store::open(file());
    write(store, {control});
    EXPECT_EQ(store.control(), control);
  }
  EXPECT_EQ(text("SELECT phase FROM campaign"), "active");
}

TEST_F(StoreDispatch, RefusesAnAuditOfMoreThanAllRuns) {
  Store store = create();
  EXPECT_EQ(store_error_of([&] { write(store, {CampaignControl{.audit_fraction = 1.5}}); }),
            message("CHECK constraint failed: audit_fraction BETWEEN 0.0 AND 1.0"));
}

// A peer may say any number.
TEST_F(StoreDispatch, KeepsAProcessNumberThatNoProcessHas) {
  WorkerJoined joined = worker_1();
  joined.process_id = std::uint64_t{1} << 63;
  Store store = create();
  write(store, {joined});
  EXPECT_EQ(text("SELECT process_id FROM worker"), "9223372036854775807");
}

TEST_F(StoreDispatch, ReportsASessionThatNobodyCanHave) {
  Store store = create();
  write(store, {worker_1()});
  change("UPDATE worker SET session = 'not hexadecimal!'");
  EXPECT_EQ(store_error_of([&] { (void)store.attached_sessions(); }),
            "campaign database = " + file().string() +
                " (is damaged: worker.session = not hexadecimal!; restore it from a copy)");
}

TEST_F(StoreDispatch, KeepsAndCountsWhoDeliveredARun) {
  Store store = create();
  write(store, {worker_1()});
  Delivery delivery = delivery_of(3);
  delivery.attempt = {7};
  delivery.compute_s = 2.25;
  write(store, {delivery, delivery_of(4)});
  write(store, {delivery_of(5), delivery_of(5)});  // The second one is not kept.

  EXPECT_EQ(text("SELECT worker || ' ' || attempt || ' ' || delivery.compute_s FROM delivery JOIN "
                 "worker USING (worker_key) WHERE run_index = 3"),
            "worker-1 7 2.25");
  EXPECT_EQ(integer("SELECT abs(received_unix_s - strftime('%s', 'now')) < 60 FROM delivery"), 1);
  EXPECT_EQ(text("SELECT num_results || ' ' || compute_s FROM worker"), "3 3.25");
}

TEST_F(StoreDispatch, ShowsHowEachRunEndedAndWhoComputedIt) {
  Store store = create();
  write(store, {worker_1()});
  Delivery without_draw = delivery_of(7);
  without_draw.result = test::result_of(7, RunStatus::no_draw);
  write(store, {delivery_of(3), without_draw});
  EXPECT_EQ(text("SELECT group_concat(run_index || ' ' || status || ' ' || worker || ' ' || host ||"
                 " ' ' || attempt || ' ' || compute_s, ';') FROM run"),
            "3 completed worker-1 node-1 1 0.5;7 no_draw worker-1 node-1 1 0.5");
  EXPECT_EQ(integer("SELECT count(*) FROM run WHERE abs(julianday(received_utc) - julianday('now'))"
                    " < 0.001"),
            2);
}

TEST_F(StoreDispatch, TakesAResultOfAWorkerThatNeverJoined) {
  Store store = create();
  write(store, {delivery_of(0)});
  EXPECT_EQ(text("SELECT session || worker || host FROM worker"), "fedcba9876543210");
  write(store, {worker_1()});
  EXPECT_EQ(text("SELECT session || worker || host FROM worker"), "fedcba9876543210worker-1node-1");
}

TEST_F(StoreDispatch, ComparesASecondResultBitForBit) {
  Store store = create();
  EXPECT_THAT(write(store, {delivery_of(0), delivery_of(1), SecondDelivery{delivery_of(0)},
                            SecondDelivery{wrong_delivery_of(1)}}),
              ElementsAre(Comparison{RunIndex{0}, session_1, true},
                          Comparison{RunIndex{1}, session_1, false}));
  EXPECT_EQ(test::results_in(store)[1].estimate, delivery_of(1).result.estimate);
  EXPECT_EQ(text("SELECT group_concat(run_index || ' ' || is_equal || ' ' || (stored_digest = "
                 "second_digest), ';') FROM audit"),
            "0 1 1;1 0 0");
}

TEST_F(StoreDispatch, LogsAResultThatContradictsTheStoredOne) {
  Store store = create();
  write(store, {worker_1(), delivery_of(0)});
  const Delivery wrong = wrong_delivery_of(0);
  EXPECT_EQ(test::num_contradicting(store.commit({&wrong, 1})), 1);
  EXPECT_EQ(text("SELECT kind || ' ' || text FROM event"),
            "contradicting_result run=0 worker=worker-1 session=fedcba9876543210 attempt=1");
}

TEST_F(StoreDispatch, KeepsWhatDifferedOnceWhateverComesLater) {
  Store store = create();
  write(store, {delivery_of(0), SecondDelivery{wrong_delivery_of(0)}});
  const std::string digest = text("SELECT second_digest FROM audit");
  write(store, {SecondDelivery{delivery_of(0)}});
  EXPECT_EQ(text("SELECT is_equal || second_digest FROM audit"), "0" + digest);

  Delivery of_another = delivery_of(0);
  of_another.worker = wire::SessionId{2};
  write(store, {SecondDelivery{of_another}});
  EXPECT_EQ(text("SELECT sum(is_equal) || ' of ' || count(*) FROM audit"), "1 of 2");
}

TEST_F(StoreDispatch, KeepsTheHistoryOfAttempts) {
  Store store = create();
  write(store, {worker_1(), lost(2, 3, 1, wire::LossReason::never_arrived),
                lost(4, 1, 2, wire::LossReason::crashed)});
  EXPECT_EQ(text("SELECT group_concat(first_run || '-' || last_run || ' ' || attempt || ' ' || "
                 "worker || ' ' || host || ' ' || reason || ' ' || is_blamed, ';') "
                 "FROM attempt_history"),
            "2-4 1 worker-1 node-1 never_arrived 0;4-4 2 worker-1 node-1 crashed 1");
}

TEST_F(StoreDispatch, KeepsTheNewestMillionLossesAndSaysSo) {
  Store store = create();
  write(store, {lost(0, 1, 1, wire::LossReason::silent)});
  change(
      "UPDATE attempt SET attempt_id = 1; INSERT INTO attempt SELECT 1000000, first_run, "
      "num_runs, attempt, worker_key, reason, is_blamed, lost_unix_s FROM attempt");
  write(store, {lost(1, 1, 1, wire::LossReason::silent), lost(2, 1, 1, wire::LossReason::silent)});
  EXPECT_EQ(text("SELECT group_concat(attempt_id) FROM attempt"), "1000000,1000001,1000002");
  EXPECT_EQ(text("SELECT group_concat(kind || ' ' || text) FROM event"),
            "attempt_history_full rows=1000000 (older ones are dropped)");
}

// Sums still follow from the deliveries: the check of the whole file holds.
TEST_F(StoreDispatch, CountsFurtherWorkersThanAHundredThousandInOneRow) {
  Store store = create();
  write(store, {delivery_of(0)});
  change(
      "INSERT INTO worker (worker_key, session, worker, host) VALUES (100000,"
      " 'ffffffffffffffff', 'last', 'here')");
  const auto of_worker = [](std::uint64_t session, std::uint64_t run) {
    Delivery delivery = delivery_of(run);
    delivery.worker = wire::SessionId{session};
    return delivery;
  };
  WorkerJoined late = worker_1();
  late.session = wire::SessionId{2};
  write(store, {late, of_worker(2, 1), of_worker(3, 2), delivery_of(3), worker_1()});
  write(store, {of_worker(4, 4), SecondDelivery{of_worker(5, 4)},
                WorkerEnded{.session = wire::SessionId{2}, .reason = wire::LossReason::silent}});
  EXPECT_EQ(text("SELECT group_concat(worker || ' ' || num_results || ' ' || compute_s, ';')"
                 " FROM worker"),
            "worker-1 2 1.0;last 0 0.0;further workers 3 1.5");
  EXPECT_EQ(text("SELECT group_concat(kind || ' ' || text) FROM event"),
            "worker_table_full rows=100000 (further workers share one row)");
  EXPECT_THAT(store.attached_sessions(), SizeIs(2));
  store.check_integrity();
}

TEST_F(StoreDispatch, KeepsSoManyComparisonsAndSaysSo) {
  constexpr std::int64_t num_rows = 10 + 1'000'000;
  {
    Store store = create(10);
    write(store, {delivery_of(0), delivery_of(1), SecondDelivery{delivery_of(0)}});
  }
  change("WITH RECURSIVE n(i) AS (SELECT 2 UNION ALL SELECT i + 1 FROM n WHERE i < " +
         std::to_string(num_rows) +
         ") INSERT INTO audit SELECT 0, i, 1, stored_digest, second_digest, 0 FROM n, audit");
  Store store = Store::open(file());
  write(store, {delivery_of(2), SecondDelivery{delivery_of(1)}, SecondDelivery{delivery_of(2)},
                SecondDelivery{delivery_of(0)}});
  EXPECT_EQ(integer("SELECT count(*) FROM audit"), num_rows);
  EXPECT_EQ(text("SELECT group_concat(kind || ' ' || text) FROM event"),
            "audit_history_full rows=1000010 (further second results are compared and not kept)");
  EXPECT_EQ(test::num_contradicting(write(store, {SecondDelivery{wrong_delivery_of(1)}})), 1);
  EXPECT_EQ(integer("SELECT count(*) FROM audit"), num_rows + 1) << "what differs is kept";
}

TEST_F(StoreDispatch, NamesEveryReason) {
  Store store = create();
  for (std::uint32_t reason = 1; reason <= 11; ++reason) {
    write(store, {lost(0, 1, 1, static_cast<wire::LossReason>(reason))});
  }
  EXPECT_EQ(text("SELECT group_concat(reason) FROM attempt"),
            "silent,crashed,out_of_memory,hung,drained,walltime,preempted,retracted,never_arrived,"
            "protocol,failed");
}

TEST_F(StoreDispatch, KeepsRunsThatAreGivenUpWithTheLastReason) {
  Store store = create();
  ReturnedRuns last = lost(5, 2, 3, wire::LossReason::crashed);
  last.reason = wire::LossReason::out_of_memory;
  write(store, {lost(4, 3, 1, wire::LossReason::crashed), lost(5, 1, 2, wire::LossReason::silent),
                last, GivenUpRun{RunIndex{5}}, GivenUpRun{RunIndex{6}}, GivenUpRun{RunIndex{9}}});
  EXPECT_EQ(text("SELECT group_concat(run_index || ' ' || reason || ' ' || num_attempts, ';') "
                 "FROM run_failure"),
            "5 out_of_memory 2;6 out_of_memory 2;9 crashed 0");
  EXPECT_THAT(store.given_up_runs(),
              ElementsAre(RunRange{RunIndex{5}, 2}, RunRange{RunIndex{9}, 1}));
}

// A coordinator that starts again does not have them computed a third time.
TEST_F(StoreDispatch, KnowsOfWhichRunsASecondResultWasCompared) {
  Store store = create(8);
  store.commit(test::deliveries_of(0, 8));
  std::vector<Entry> entries;
  for (const Delivery& delivery : test::deliveries_of(2, 4)) {
    entries.emplace_back(SecondDelivery{delivery});
  }
  entries.push_back(entries.at(0));
  store.write(entries);
  EXPECT_THAT(store.compared_runs(), ElementsAre(RunRange{RunIndex{2}, 2}));
}

TEST_F(StoreDispatch, PrefersAResultToAFailureInEitherOrder) {
  Store store = create();
  write(store, {GivenUpRun{RunIndex{1}}, GivenUpRun{RunIndex{2}}, delivery_of(2)});
  EXPECT_THAT(store.given_up_runs(), ElementsAre(RunRange{RunIndex{1}, 1}));
  write(store, {delivery_of(1)});
  write(store, {GivenUpRun{RunIndex{1}}});
  EXPECT_THAT(store.given_up_runs(), IsEmpty());
  EXPECT_THAT(store.finished_runs(), ElementsAre(RunRange{RunIndex{1}, 2}));
}

TEST_F(StoreDispatch, TellsTheNextCoordinatorWhichOpenRunsCrashedWorkers) {
  Store store = create();
  write(store, {lost(2, 4, 1, wire::LossReason::crashed), lost(3, 1, 4, wire::LossReason::crashed),
                lost(3, 1, 2, wire::LossReason::crashed), lost(8, 1, 1, wire::LossReason::silent),
                delivery_of(4), GivenUpRun{RunIndex{5}}});
  EXPECT_THAT(Store::open_read_only(file()).blamed_runs(),
              ElementsAre(BlamedRun{RunIndex{2}, 1, {1}}, BlamedRun{RunIndex{3}, 3, {4}}));
}

TEST_F(StoreDispatch, WritesAllEntriesOrNone) {
  Store store = create(5);
  const std::string error = store_error_of([&] {
    write(store, {worker_1(), delivery_of(0), lost(1, 1, 1, wire::LossReason::crashed),
                  CampaignControl{.audit_fraction = -1.0}});
  });
  EXPECT_NE(error, "");
  EXPECT_THAT(store.finished_runs(), IsEmpty());
  EXPECT_EQ(integer("SELECT (SELECT count(*) FROM worker) + (SELECT count(*) FROM attempt)"), 0);

  EXPECT_TRUE(write(store, {delivery_of(0)}).empty());  // With a new row for its worker.
  EXPECT_EQ(text("SELECT num_results FROM worker"), "1");
}

TEST_F(StoreDispatch, ShowsTheProgress) {
  Store store = create(10);
  std::vector<Entry> entries{GivenUpRun{RunIndex{9}}};
  for (const auto status : {RunStatus::completed, RunStatus::not_converged, RunStatus::not_finite,
                            RunStatus::not_finite, RunStatus::no_draw}) {
    Delivery delivery = delivery_of(entries.size());
    delivery.result = test::result_of(entries.size(), status);
    entries.push_back(delivery);
  }
  entries.push_back(SecondDelivery{wrong_delivery_of(1)});
  write(store, entries);
  EXPECT_EQ(text("SELECT campaign || ' ' || phase || ' ' || num_runs || ' ' || num_finished || ' '"
                 " || num_given_up || ' ' || num_open || ' ' || num_not_converged || ' ' || "
                 "num_not_finite || ' ' || num_no_draw || ' ' || num_compared || ' ' || "
                 "num_contradicting FROM campaign_progress"),
            "hardy2013 active 10 5 1 4 1 2 1 1 1");
  EXPECT_EQ(integer("SELECT abs(strftime('%s', last_result_utc) - strftime('%s', 'now')) < 60 "
                    "FROM campaign_progress"),
            1);
}

TEST_F(StoreDispatch, ShowsTheThroughputOfWorkers) {
  Store store = create(10);
  write(store, {worker_1(), delivery_of(0), delivery_of(1),
                WorkerJoined{.session = {2}, .name = "idle", .host = "node-2"}});
  change(
      "UPDATE worker SET first_seen_utc = strftime('%Y-%m-%dT%H:%M:%SZ', "
      "last_result_unix_s - 60, 'unixepoch') WHERE worker = 'worker-1'");
  EXPECT_EQ(text("SELECT group_concat(worker || ' ' || num_results || ' ' || compute_s || ' ' || "
                 "ifnull(run_s, '-') || ' ' || ifnull(results_per_h, '-'), ';') "
                 "FROM worker_throughput"),
            "worker-1 2 1.0 0.5 120.0;idle 0 0.0 - -");
}

TEST_F(StoreDispatch, KeepsTheNewestEventsAndCutsLongOnes) {
  Store store = create(1);
  store.record_event("long", std::string(3000, 'x'));
  EXPECT_EQ(text("SELECT text FROM event"), std::string(2000, 'x'));
  change("INSERT INTO event (event_id, kind, text) VALUES (10000, 'old', '')");
  store.record_event("new", "");
  EXPECT_EQ(text("SELECT group_concat(kind) FROM event"), "old,new");
}

}  // namespace
}  // namespace proofmass::coordinator
