// Tags, notes and the stop plan of a campaign database.

#include <gmock/gmock.h>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/detail/schema.hpp"
#include "coordinator/store/store.hpp"
#include "core/error.hpp"
#include "tests/coordinator/store/store_fixture.hpp"
#include "tests/message_of.hpp"

namespace proofmass::coordinator {
namespace {

using detail::Access;
using detail::Database;
using test::campaign_of;
using test::store_error_of;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::MatchesRegex;

class StoreAnnotation : public test::StoreTest {
 protected:
  void SetUp() override { Store::create(file(), campaign_of(10), ""); }

  void annotate(const Annotation& annotation) const { Store::annotate(file(), {annotation}); }
  [[nodiscard]] std::string error_of(const Annotation& annotation) const {
    return test::message_of<Error>([&] { annotate(annotation); });
  }
  [[nodiscard]] std::vector<std::string> tags() const {
    return Store::open_read_only(file()).tags();
  }
  [[nodiscard]] std::vector<std::string> notes() const {
    std::vector<std::string> texts;
    for (const Note& note : Store::open_read_only(file()).notes()) texts.push_back(note.text);
    return texts;
  }
};

TEST_F(StoreAnnotation, AddsAndRemovesTags) {
  annotate(AddTag{"v1.0_final-2"});
  annotate(AddTag{"2026"});
  annotate(AddTag{"2026"});
  EXPECT_THAT(tags(), ElementsAre("2026", "v1.0_final-2"));
  annotate(RemoveTag{"2026"});
  EXPECT_THAT(tags(), ElementsAre("v1.0_final-2"));
  EXPECT_EQ(error_of(RemoveTag{"2026"}), "tag = 2026 (is none of this campaign)");
}

TEST_F(StoreAnnotation, TakesTagsThatNeedNoQuotesOnly) {
  const std::string rule = " (must be 1 to 64 of the characters A-Z a-z 0-9 . _ -)";
  EXPECT_EQ(error_of(AddTag{""}), "tag = " + rule);
  EXPECT_EQ(error_of(AddTag{"a b"}), "tag = a b" + rule);
  EXPECT_EQ(error_of(AddTag{"é"}), "tag = é" + rule);
  EXPECT_EQ(error_of(AddTag{std::string(65, 'a')}), "tag = " + std::string(65, 'a') + rule);
  EXPECT_EQ(error_of(RemoveTag{"'"}), "tag = '" + rule);
  EXPECT_THROW(annotate(AddTag{"a b"}), InvalidArgument);
  annotate(AddTag{std::string(64, 'a')});
  EXPECT_THAT(tags(), ElementsAre(std::string(64, 'a')));
}

TEST_F(StoreAnnotation, KeepsNotesInTheirOrder) {
  annotate(AddNote{"zweite Zeile\nfür K2c: 274 s²/m 🛰"});
  annotate(AddNote{std::string(2000, 'a')});
  annotate(AddNote{"274\xc2\xa0s²/m"});  // A space that keeps a line together.
  const std::vector<Note> notes = Store::open_read_only(file()).notes();
  ASSERT_EQ(notes.size(), 3u);
  EXPECT_EQ(notes[0].text, "zweite Zeile\nfür K2c: 274 s²/m 🛰");
  EXPECT_EQ(notes[1].text, std::string(2000, 'a'));
  EXPECT_THAT(notes[0].time_utc, MatchesRegex("20[0-9-]+T[0-9:]+Z"));
}

TEST_F(StoreAnnotation, RefusesNotesThatAreNoText) {
  EXPECT_EQ(error_of(AddNote{""}), "note = 0 bytes (must be 1 to 2000 bytes)");
  EXPECT_EQ(error_of(AddNote{std::string(2001, 'a')}),
            "note = 2001 bytes (must be 1 to 2000 bytes)");
  const std::vector<std::string> texts{
      "\x1b[31m",          // A command to the terminal,
      "\xc2\x9b",          // the same in two bytes,
      std::string(1, 0),   // the end of a C string,
      "\x7f",              // delete,
      "\xff",              // never a part of UTF-8,
      "\xc3",              // half a character,
      "\xc3(",             // followed by what does not continue it,
      "\xc0\xaf",          // a longer form than needed,
      "\xe0\x80\xaf",      // likewise,
      "\xed\xa0\x80",      // a surrogate,
      "\xf4\x90\x80\x80",  // beyond Unicode.
  };
  for (const std::string& text : texts) {
    EXPECT_EQ(error_of(AddNote{text}),
              "note = " + std::to_string(text.size()) +
                  " bytes (must be UTF-8 without control characters but the end of a line)");
  }
  EXPECT_THAT(notes(), IsEmpty());
}

TEST_F(StoreAnnotation, HasALimit) {
  for (int i = 0; i < 100; ++i) annotate(AddTag{std::to_string(i)});
  EXPECT_EQ(error_of(AddTag{"100"}), "tags = 101 (a campaign has at most 100)");
  annotate(AddTag{"99"});
  EXPECT_EQ(tags().size(), 100u);
  Database(file(), Access::read_write)
      .execute(
          "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < 1000) "
          "INSERT INTO note (text) SELECT 'text' FROM n");
  EXPECT_EQ(error_of(AddNote{"text"}), "notes = 1001 (a campaign has at most 1000)");
  EXPECT_EQ(notes().size(), 1000u);
}

TEST_F(StoreAnnotation, WorksWhileACoordinatorServesTheFile) {
  Store store = Store::open(file());
  store.commit(test::deliveries_of(0, 3));
  annotate(AddTag{"live"});
  annotate(AddNote{"text"});
  store.commit(test::deliveries_of(3, 5));
  EXPECT_THAT(store.tags(), ElementsAre("live"));
  EXPECT_EQ(store.notes().size(), 1u);
  EXPECT_EQ(store.finished_runs(), (std::vector{RunRange{RunIndex{0}, 5}}));
}

TEST_F(StoreAnnotation, LeavesOneFile) {
  annotate(AddTag{"tag"});
  EXPECT_THAT(file_names(), ElementsAre("campaign.db"));
}

TEST_F(StoreAnnotation, RefusesFilesThatAreMissingOrHaveTwoNames) {
  const std::filesystem::path missing = directory() / "missing.db";
  EXPECT_EQ(store_error_of([&] { Store::annotate(missing, {AddTag{"a"}}); }),
            "campaign database = " + missing.string() + " (does not exist)");
  std::filesystem::create_hard_link(file(), directory() / "other.db");
  EXPECT_EQ(error_of(AddTag{"a"}),
            "campaign database = " + file().string() +
                " (has 2 names (hard links), must have one; make copies instead)");
}

using StoreStop = StoreAnnotation;

TEST_F(StoreStop, PlanIsKept) {
  EXPECT_EQ(Store::open_read_only(file()).stop_plan(), StopPlan{});
  const StopPlan plan{.stop_rule = "std(a_c13) within 5%", .num_runs_max = 5000, .failures_max = 0};
  Store::open(file()).set_stop_plan(plan);
  EXPECT_EQ(Store::open_read_only(file()).stop_plan(), plan);
  Store::open(file()).set_stop_plan({});
  EXPECT_EQ(Store::open_read_only(file()).stop_plan(), StopPlan{});
}

// Also if the process ends in between.
TEST_F(StoreStop, PlanThatIsNewLeavesAFinishedCampaignActiveUntilItsRuleIsChecked) {
  Store store = Store::open(file());
  const Entry finished = CampaignControl{.phase = wire::CampaignPhase::finished};
  (void)store.write({&finished, 1});
  store.set_stop_plan({.stop_rule = "", .num_runs_max = {}, .failures_max = 3});
  EXPECT_EQ(store.control().phase, wire::CampaignPhase::finished) << "no rule";
  const StopPlan plan{.stop_rule = "std(a_c13) within 5%", .num_runs_max = 50, .failures_max = {}};
  store.set_stop_plan(plan);
  EXPECT_EQ(store.control().phase, wire::CampaignPhase::active);
  (void)store.write({&finished, 1});
  store.set_stop_plan(plan);
  EXPECT_EQ(store.control().phase, wire::CampaignPhase::finished) << "the same plan";
}

TEST_F(StoreStop, ChecksAreKeptOnceForEachCount) {
  Store store = Store::open(file());
  store.record_stop_check(128, "std(a_c13)", {});
  store.record_stop_check(192, "std(a_c13)",
                          {.is_reached = true,
                           .estimate = 0.5,
                           .interval = Interval{.lower = 0.25, .upper = 0.75, .confidence = 0.95},
                           .relative_half_width = 0.125});
  StopCheck again;
  again.estimate = 2.0;
  store.record_stop_check(128, "std(a_c13)", again);
  const Database database(file(), Access::read_only);
  EXPECT_EQ(
      database.text("SELECT group_concat(num_runs || ' ' || statistic || ' ' || estimate || ' ' || "
                    "coalesce(lower, '-') || ' ' || coalesce(upper, '-') || ' ' || "
                    "coalesce(relative_half_width, '-') || ' ' || is_reached, ';') "
                    "FROM stop_check"),
      "128 std(a_c13) 2.0 - - - 0;192 std(a_c13) 0.5 0.25 0.75 0.125 1");
}

}  // namespace
}  // namespace proofmass::coordinator
