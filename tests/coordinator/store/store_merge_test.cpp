// Databases of parts of one campaign become one: what it then holds is what one coordinator that
// had seen all deliveries would hold.

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/store.hpp"
#include "tests/coordinator/store/store_fixture.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

using test::text_in;

constexpr std::uint64_t num_runs = 10;
constexpr wire::SessionId session_2{2};

class StoreMerge : public test::StoreTest {
 protected:
  /// A part of a campaign, and the entries that its coordinator wrote.
  std::filesystem::path part(const std::string& name, const std::vector<Entry>& entries) const {
    const std::filesystem::path path = directory() / name;
    (void)Store::create(path, campaign_of(num_runs), "as text").write(entries);
    return path;
  }

  [[nodiscard]] std::filesystem::path whole() const { return directory() / "whole.db"; }

  std::vector<MergedPart> merge(const std::vector<std::filesystem::path>& parts) const {
    std::vector<MergedPart> merged;
    (void)Store::merge(whole(), campaign_of(num_runs), "as text", parts,
                       [&](const MergedPart& of_part) { merged.push_back(of_part); });
    return merged;
  }

  [[nodiscard]] std::string text(const std::string& sql) const { return text_in(whole(), sql); }
};

/// By the other worker.
Delivery second_delivery_of(std::uint64_t run) {
  Delivery delivery = delivery_of(run);
  delivery.worker = session_2;
  delivery.attempt = {3};
  delivery.compute_s = 0.25;
  return delivery;
}

WorkerJoined worker_2() {
  return {.session = session_2,
          .name = "worker-2",
          .host = "node-2",
          .process_id = 7,
          .cards = "1 A100"};
}

std::vector<Entry> entries_of(std::vector<Entry> entries, const std::vector<std::uint64_t>& runs,
                              Delivery (*delivery)(std::uint64_t)) {
  for (const std::uint64_t run : runs) entries.emplace_back(delivery(run));
  return entries;
}

ReturnedRuns crashed(std::uint64_t run, wire::SessionId worker) {
  return {.runs = {RunIndex{run}, 1},
          .attempt = {1},
          .worker = worker,
          .reason = wire::LossReason::crashed,
          .is_blamed = true};
}

TEST_F(StoreMerge, KeepsWhoComputedWhatAndWhen) {
  const auto a = part("a.db", entries_of({test::worker_1()}, {0, 1}, delivery_of));
  const auto b = part("b.db", entries_of({worker_2(), test::worker_1()}, {2}, second_delivery_of));
  test::change(a,
               "UPDATE delivery SET received_unix_s = 1000 + run_index;"
               "UPDATE worker SET last_result_unix_s = 1001");
  (void)merge({a, b});
  EXPECT_EQ(text("SELECT group_concat(run_index || ' ' || worker || ' ' || attempt || ' ' || "
                 "delivery.compute_s || ' ' || (received_unix_s < 2000), ', ') FROM delivery JOIN "
                 "worker USING (worker_key)"),
            "0 worker-1 1 0.5 1, 1 worker-1 1 0.5 1, 2 worker-2 3 0.25 0");
  EXPECT_EQ(text("SELECT group_concat(worker || ' ' || num_results || ' ' || compute_s || ' ' ||"
                 " cards, ', ') FROM worker"),
            "worker-1 2 1.0 , worker-2 1 0.25 1 A100");
  EXPECT_EQ(text("SELECT last_result_unix_s FROM worker WHERE worker = 'worker-1'"), "1001");
  // Nobody waits for a worker of a part.
  EXPECT_TRUE(Store::open_read_only(whole()).attached_sessions().empty());
}

TEST_F(StoreMerge, TakesTheFirstDeliveryOfARunThatSeveralPartsHave) {
  const auto a = part("a.db", entries_of({test::worker_1()}, {0, 1, 2}, delivery_of));
  const auto b = part("b.db", entries_of({worker_2()}, {1, 2, 3}, second_delivery_of));
  EXPECT_THAT(merge({a, b}),
              ElementsAre(MergedPart{.num_new = 3}, MergedPart{.num_new = 1, .num_again = 2}));
  EXPECT_EQ(text("SELECT group_concat(attempt) FROM delivery"), "1,1,1,3");
  const Store store = Store::open_read_only(whole());
  EXPECT_EQ(store.control().phase, wire::CampaignPhase::active);
  EXPECT_NO_THROW(store.check_integrity());
}

// One estimate is off by its last bit.
TEST_F(StoreMerge, RefusesAnotherResultOfARunAndMakesNoFile) {
  const auto a = part("a.db", entries_of({test::worker_1()}, {0, 1}, delivery_of));
  const auto b = part("b.db", entries_of({test::worker_1()}, {1}, test::wrong_delivery_of));
  EXPECT_THAT(store_error_of([&] {
                (void)merge({a, b});
              }),
              HasSubstr("b.db (has another result of run 1 than a part before it"));
  EXPECT_FALSE(std::filesystem::exists(whole()));
  EXPECT_EQ(file_names(), (std::set<std::string>{"a.db", "b.db"}));
}

TEST_F(StoreMerge, KeepsLossesAndPrefersAResultToAFailure) {
  const auto a =
      part("a.db", {test::worker_1(), crashed(4, test::session_1), crashed(5, test::session_1),
                    GivenUpRun{RunIndex{4}}, GivenUpRun{RunIndex{5}}});
  const auto b = part("b.db", {worker_2(), crashed(5, session_2), second_delivery_of(5)});
  (void)merge({b, a});
  EXPECT_THAT(Store::open_read_only(whole()).given_up_runs(),
              ElementsAre(RunRange{RunIndex{4}, 1}));
  EXPECT_EQ(text("SELECT group_concat(first_run || ' ' || worker || ' ' || reason, ', ')"
                 " FROM attempt JOIN worker USING (worker_key)"),
            "5 worker-2 crashed, 4 worker-1 crashed, 5 worker-1 crashed");
}

// A copy of a part, or a merged database and a part of it.
TEST_F(StoreMerge, KeepsEachLossOnce) {
  const auto a =
      part("a.db", {test::worker_1(), crashed(4, test::session_1), crashed(5, test::session_1)});
  std::filesystem::copy_file(a, directory() / "copy.db");
  (void)merge({a, directory() / "copy.db"});
  EXPECT_EQ(text("SELECT group_concat(first_run, ', ') FROM attempt"), "4, 5");
}

TEST_F(StoreMerge, KeepsComparisonsAndTheLargestErrors) {
  const auto a = part("a.db", {test::worker_1(), delivery_of(0), worker_2(),
                               SecondDelivery{second_delivery_of(0)}, delivery_of(1)});
  const auto b = part("b.db", {worker_2(), second_delivery_of(2)});
  (void)merge({a, b});
  const Store store = Store::open_read_only(whole());
  EXPECT_EQ(store.num_compared(), 1U);
  EXPECT_NO_THROW(store.check_integrity());
  EXPECT_EQ(text("SELECT group_concat(DISTINCT run_index) FROM worst_run"), "0,1,2");
}

}  // namespace
}  // namespace proofmass::coordinator
