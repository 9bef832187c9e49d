#include "coordinator/store/store_writer.hpp"

#include <sched.h>
#include <sys/mount.h>

#include "coordinator/store/detail/database.hpp"
#include "tests/coordinator/store/writer_fixture.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

using detail::Access;
using detail::Database;
using test::patient_config;
using test::worker_1;

using StoreWriterTest = test::WriterTest;

TEST_F(StoreWriterTest, NamesResultsOnceTheyAreStored) {
  StoreWriter& writer = serve(100);
  for (const std::uint64_t run : {4u, 2u, 3u}) writer.write(id, delivery_of(run));
  EXPECT_THAT(take_completions(), IsEmpty());
  writer.flush();
  EXPECT_THAT(take_completions(), ElementsAre("committed 4 2 3"));
  EXPECT_EQ(results_in(Store::open_read_only(file())).size(), 3u);
  writer.flush();
  EXPECT_THAT(take_completions(), IsEmpty());
}

TEST_F(StoreWriterTest, CommitsAsSoonAsEnoughResultsWait) {
  WriterConfig config = patient_config();
  config.commit_runs_max = 3;
  serve(100, config);
  write_runs(0, 3);
  wait_for("committed 0 1 2");
}

TEST_F(StoreWriterTest, CommitsAFewResultsAfterAWhile) {
  WriterConfig config = patient_config();
  config.commit_after = std::chrono::milliseconds(1);
  StoreWriter& writer = serve(100, config);
  writer.write(id, delivery_of(7));
  wait_for("committed 7");
}

TEST_F(StoreWriterTest, CommitsAtOnceWhatNoMoreResultsFollow) {
  StoreWriter& writer = serve(100);
  writer.hurry(id);
  writer.write(id, delivery_of(7));
  EXPECT_THAT(take_completions(), IsEmpty()) << "there was nothing to hurry with";
  writer.hurry(id);
  wait_for("committed 7");
}

TEST_F(StoreWriterTest, WritesMoreThanFitsIntoOneTransaction) {
  constexpr std::uint64_t num_runs = 20'000;
  StoreWriter& writer = serve(num_runs);
  write_runs(0, num_runs);
  writer.flush();
  std::uint64_t next = 0;
  for (const Completion& completion : writer.take_completions()) {
    for (const RunIndex run : std::get<Committed>(completion).runs) EXPECT_EQ(run.value, next++);
  }
  EXPECT_EQ(next, num_runs);
}

TEST_F(StoreWriterTest, ComparesWithWhatWasDeliveredJustBefore) {
  StoreWriter& writer = serve(100);
  writer.write(id, delivery_of(1));
  writer.write(id, SecondDelivery{delivery_of(1)});
  writer.write(id, SecondDelivery{wrong_delivery_of(1)});
  writer.flush();
  EXPECT_THAT(take_completions(),
              ElementsAre("committed 1", "compared 1 equal", "compared 1 different"));
}

TEST_F(StoreWriterTest, WritesEveryKindOfRecord) {
  StoreWriter& writer = serve(100);
  writer.write(id, worker_1());
  writer.write(id, ReturnedRuns{.runs = {RunIndex{3}, 1},
                                .attempt = {1},
                                .worker = test::session_1,
                                .reason = wire::LossReason::crashed,
                                .is_blamed = true});
  writer.write(id, ReturnedRuns{.runs = {RunIndex{4}, 1},
                                .attempt = {1},
                                .worker = test::session_1,
                                .reason = wire::LossReason::crashed,
                                .is_blamed = true});
  writer.write(id, GivenUpRun{RunIndex{4}});
  const std::chrono::sys_days happened_at{std::chrono::year{2024} / 2 / 29};
  writer.write(id, EventEntry{.kind = "note",
                              .text = "text",
                              .time = happened_at + std::chrono::microseconds(1'007'999)});
  writer.write(id, CampaignControl{.phase = wire::CampaignPhase::paused, .priority = 3});
  const Store store = writer.close(id);

  EXPECT_THAT(store.attached_sessions(), ElementsAre(test::session_1));
  EXPECT_THAT(store.blamed_runs(), ElementsAre(BlamedRun{RunIndex{3}, 1, {1}}));
  EXPECT_THAT(store.given_up_runs(), ElementsAre(RunRange{RunIndex{4}, 1}));
  EXPECT_EQ(store.control().phase, wire::CampaignPhase::paused);
  EXPECT_EQ(text("SELECT time_utc || kind || text FROM event"), "2024-02-29T00:00:01.007Znotetext");
  EXPECT_THAT(take_completions(), IsEmpty());
}

// A join of one campaign's worker writes nothing to the files of the others, nor does its end.
TEST_F(StoreWriterTest, TellsOnlyTheFilesThatKnowAWorkerOfIt) {
  constexpr wire::CampaignId other{2};
  const std::filesystem::path other_file = directory() / "other.db";
  StoreWriter& writer = serve(100);
  writer.open(other, Store::create(other_file, campaign_of(100), ""));
  writer.write(id, worker_1());
  writer.write(id, WorkerJoined{.session = {2}, .name = "gone", .host = "node-2"});
  writer.flush();
  writer.write({}, WorkerEnded{.session = {2}, .reason = wire::LossReason::drained});
  EXPECT_THAT(writer.close(id).attached_sessions(), ElementsAre(test::session_1));
  const Store untouched = writer.close(other);
  EXPECT_EQ(untouched.log_size(), 0u);
  EXPECT_EQ(Database(other_file, Access::read_only).integer("SELECT count(*) FROM worker"), 0);
}

TEST_F(StoreWriterTest, TellsAFileOfTheEndOfAWorkerThatItKnewBefore) {
  serve(100);
  StoreWriter& first = start();
  first.open(id, Store::open(file()));
  first.write(id, worker_1());
  end();
  StoreWriter& writer = start();
  writer.open(id, Store::open(file()));
  writer.write({}, WorkerEnded{.session = test::session_1, .reason = wire::LossReason::silent});
  EXPECT_THAT(writer.close(id).attached_sessions(), IsEmpty());
}

// History waits for the next result, or for a second, so that workers that come and go cost no
// commits of their own.
TEST_F(StoreWriterTest, LetsRecordsWaitLongerThanResults) {
  WriterConfig config = patient_config();
  config.commit_after = std::chrono::milliseconds(1);
  StoreWriter& writer = serve(100, config);
  writer.write(id, EventEntry{.kind = "early", .text = ""});
  writer.write(id, delivery_of(7));
  wait_for("committed 7");
  EXPECT_EQ(text("SELECT group_concat(kind) FROM event"), "early");
  config.record_after = std::chrono::milliseconds(1);
  config.commit_after = std::chrono::hours(1);
  StoreWriter& hasty = start(config);
  hasty.open(id, Store::open(file()));
  hasty.write(id, delivery_of(8));
  hasty.write(id, EventEntry{.kind = "late", .text = ""});
  wait_for("committed 8");
}

TEST_F(StoreWriterTest, KeepsSeveralCampaignsApart) {
  constexpr wire::CampaignId other{2};
  StoreWriter& writer = serve(100);
  writer.open(other, Store::create(directory() / "other.db", campaign_of(100), ""));
  writer.write(id, delivery_of(1));
  writer.write(other, delivery_of(2));
  writer.write(other, EventEntry{.kind = "one", .text = ""});
  writer.write({}, EventEntry{.kind = "all", .text = ""});
  writer.flush();
  EXPECT_THAT(take_completions(), ElementsAre("committed 1", "committed 2"));
  const std::string kinds = "SELECT group_concat(kind) FROM event";
  EXPECT_EQ(text(kinds), "all");
  EXPECT_EQ(Database(directory() / "other.db", Access::read_only).text(kinds), "one,all");
}

TEST_F(StoreWriterTest, GivesTheFileBackWithAllThatWasHandedOver) {
  StoreWriter& writer = serve(100);
  writer.write(id, delivery_of(5));
  {
    Store store = writer.close(id);
    EXPECT_THAT(store.finished_runs(), ElementsAre(RunRange{RunIndex{5}, 1}));
    writer.open(id, std::move(store));
  }
  writer.write(id, delivery_of(6));
  writer.flush();
  EXPECT_THAT(take_completions(), ElementsAre("committed 5", "committed 6"));
}

TEST_F(StoreWriterTest, LetsOthersUseTheFileAfterAllThatWasHandedOver) {
  StoreWriter& writer = serve(100);
  writer.write(id, delivery_of(99));
  writer.access(id, [](Store& store) {
    EXPECT_THAT(store.finished_runs(), ElementsAre(RunRange{RunIndex{99}, 1}));
    store.extend(campaign_of(200), "");
  });
  writer.write(id, delivery_of(199));
  EXPECT_EQ(test::store_error_of([&] {
              writer.access(id, [](Store& store) { store.extend(campaign_of(150), ""); });
            }),
            message("has 200 runs, and was to have 150"));
  EXPECT_THAT(take_completions(), ElementsAre("committed 99", "committed 199"));
}

// A reader in the middle of a table holds its state of the file; the log cannot begin anew.
TEST_F(StoreWriterTest, SaysThatAReaderMakesTheLogGrow) {
  WriterConfig config = patient_config();
  config.log_size_max = 8'000'000;
  StoreWriter& writer = serve(50'000, config);
  write_runs(0, 10'000);
  writer.flush();
  EXPECT_THAT(take_completions(), ::testing::Not(::testing::Contains("write_ahead_log_grown")));
  {
    const Database reader(file(), Access::read_only);
    detail::Statement select = reader.prepare("SELECT * FROM run_result");
    ASSERT_TRUE(select.step());
    write_runs(10'000, 50'000);
    writer.flush();
    for (int i = 0; i < 3; ++i) {
      writer.write(id, EventEntry{.kind = "note", .text = ""});
      writer.flush();
    }
    const std::vector<std::string> texts = take_completions();
    EXPECT_EQ(std::ranges::count(texts, "write_ahead_log_grown"), 1);
    EXPECT_THAT(texts, ::testing::Not(::testing::Contains("write_ahead_log_shrunk")));
  }
  // One commit puts all that is in the log into the file, the next one begins the log anew.
  for (int i = 0; i < 2; ++i) {
    writer.write(id, EventEntry{.kind = "note", .text = ""});
    writer.flush();
  }
  EXPECT_THAT(take_completions(), ElementsAre("write_ahead_log_shrunk"));
  const Store store = writer.close(id);
  EXPECT_LT(store.log_size(), config.log_size_max);
  EXPECT_THAT(store.finished_runs(), ElementsAre(RunRange{RunIndex{0}, 50'000}));
}

TEST_F(StoreWriterTest, WritesWhatWaitsWhenItEnds) {
  serve(100);
  StoreWriter& writer = start();  // The file of the first one is free.
  writer.open(id, Store::open(file()));
  write_runs(0, 50);
  end();
  EXPECT_EQ(results_in(Store::open(file())).size(), 50u);
  EXPECT_THAT(file_names(), ElementsAre("campaign.db"));
}

// A writer whose disk does not take what it is given.

using test::committed;
using test::FileSizeLimit;

class StoreWriterDisk : public test::WriterTest {
 protected:
  /// `failed campaign database = <file()> (<reason>)`
  [[nodiscard]] std::string failed(const std::string& reason) const {
    return "failed campaign database = " + file().string() + " (" + reason + ")";
  }
  const std::string io_error = "disk I/O error; what was committed before is safe";
};

constexpr rlim_t small_size = 150'000;  // More than a new campaign database needs.

TEST_F(StoreWriterDisk, DropsRecordsThatNobodyWaitsForBeyondALimit) {
  WriterConfig config = patient_config();
  config.num_records_max = 3;
  StoreWriter& writer = serve(5000, config);
  {
    const FileSizeLimit limit(small_size);
    write_runs(0, 2000);
    writer.flush();
    for (const std::string kind : {"a", "b", "c", "d", "e"}) {
      writer.write(id, EventEntry{.kind = kind, .text = ""});
    }
    writer.flush();
  }
  writer.flush();
  EXPECT_THAT(take_completions(), Contains("recovered"));
  EXPECT_EQ(text("SELECT group_concat(kind || text) FROM event"),
            "a,b,c,records_droppedlosses_and_events=2 (the disk did not take them for too long)");
}

TEST_F(StoreWriterDisk, ReportsWhatNoDiskIsToBlameFor) {
  StoreWriter& writer = serve(5);
  writer.write(id, delivery_of(5));
  writer.flush();
  EXPECT_THAT(take_completions(),
              ElementsAre("failed run_result.run_index = 5 (must be below num_runs = 5)"));
}

TEST_F(StoreWriterDisk, ServesOtherFilesWhileOneFails) {
  constexpr wire::CampaignId other{2};
  StoreWriter& writer = serve(5);
  writer.open(other, Store::create(directory() / "other.db", campaign_of(100), ""));
  writer.write(id, delivery_of(5));
  writer.write(other, delivery_of(5));
  writer.flush();
  EXPECT_THAT(take_completions(), Contains("committed 5"));
  EXPECT_THAT(Store::open_read_only(file()).finished_runs(), IsEmpty());
}

TEST_F(StoreWriterDisk, GivesBackAFileThatCannotBeWritten) {
  StoreWriter& writer = serve(5000);
  const FileSizeLimit limit(small_size);
  write_runs(0, 2000);
  const Store store = writer.close(id);
  EXPECT_THAT(store.finished_runs(), IsEmpty());
  EXPECT_THAT(take_completions(), ElementsAre(failed(io_error)));
}

TEST_F(StoreWriterDisk, EndsWithoutWaitingForIt) {
  serve(5000);
  {
    const FileSizeLimit limit(small_size);
    write_runs(0, 2000);
    end();
  }
  EXPECT_THAT(Store::open(file()).finished_runs(), IsEmpty());
}

}  // namespace
}  // namespace proofmass::coordinator
