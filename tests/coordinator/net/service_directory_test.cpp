// A service and the files of its directory: those that cannot be served, and those that need not.

#include <sqlite3.h>

#include "coordinator/net/service_sockets.hpp"
#include "coordinator/store/campaign_record.hpp"
#include "coordinator/store/records.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "tests/coordinator/net/plain_directory.hpp"
#include "tests/coordinator/net/playing_client.hpp"
#include "tests/coordinator/net/service_fixture.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

namespace fs = std::filesystem;
using test::PlainDirectory;
using test::PlayingWorker;

std::string bytes_of(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

void write_bytes(const fs::path& file, const std::string& bytes) {
  std::ofstream(file, std::ios::binary) << bytes;
}

class ServiceWithADirectory : public test::ServiceTest {
 protected:
  ServiceWithADirectory() {
    config.clients_endpoint = "tcp://127.0.0.1:*";
    config.directory = &folder;
    config.writer.retry_after = std::chrono::milliseconds(10);
  }
  ~ServiceWithADirectory() override {
    end(StopRequest::now);
  }  // It reads the directory until then.

  void make_file(const std::string& name, std::uint64_t num_runs = 1) {
    (void)files.open(test::campaign_of(name, num_runs), {}, {});
  }
  /// A campaign of which every run was given up.
  void make_finished_file(const std::string& name) {
    ServedCampaign campaign = files.open(test::campaign_of(name, 2), {}, {});
    const std::vector<coordinator::Entry> entries{
        GivenUpRun{RunIndex{0}}, GivenUpRun{RunIndex{1}},
        CampaignControl{.phase = wire::CampaignPhase::finished, .priority = 3}};
    (void)campaign.store.write(entries);
  }

  /// As another program may do it.
  void change_file(const std::string& name, const std::string& assignment) {
    execute(name, "UPDATE campaign SET " + assignment);
  }
  void execute(const std::string& name, const std::string& sql) {
    sqlite3* file = nullptr;
    ASSERT_EQ(sqlite3_open((directory / (name + ".db")).c_str(), &file), SQLITE_OK);
    EXPECT_EQ(sqlite3_exec(file, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK);
    sqlite3_close(file);
  }

  void start_service() {
    start({});
    client.emplace(service->clients_endpoint());
  }

  std::vector<std::string> served() {
    std::vector<std::string> names;
    const proto::StatusReply status = client->status();
    for (const auto& campaign : status.campaigns()) names.push_back(campaign.name());
    return names;
  }

  PlainDirectory folder{directory};
  std::optional<test::PlayingClient> client;
};

// A coordinator that is killed while it folds the log in, on a full disk perhaps, leaves a file
// that names more pages than it has. The log has the others.
TEST_F(ServiceWithADirectory, ServesAFileWhoseLogWasFoldedInHalfway) {
  const fs::path file = directory / "a.db";
  std::string before;
  std::string log;
  {
    ServedCampaign campaign = files.open(test::campaign_of("a", 1), {}, {});
    ASSERT_EQ(campaign.store.rest(), std::nullopt);
    before = bytes_of(file);
    for (int i = 0; i < 100; ++i) campaign.store.record_event("test", std::string(1000, 'x'));
    log = bytes_of(directory / "a.db-wal");
  }
  const std::string after = bytes_of(file);
  ASSERT_GT(after.size(), before.size());
  constexpr std::size_t first_page_size = 4096;
  write_bytes(file, after.substr(0, first_page_size) + before.substr(first_page_size));
  write_bytes(directory / "a.db-wal", log);
  start_service();
  EXPECT_THAT(client->status().unserved_files(), IsEmpty());
  EXPECT_THAT(served(), ElementsAre("a"));
}

TEST_F(ServiceWithADirectory, ServesTheOthersWhateverAFileThrows) {
  make_file("a");
  make_file("b");
  make_file("c");
  folder.set_before_load([](const fs::path& file) {
    if (file.stem() == "a") throw fs::filesystem_error("rename", std::error_code());
    if (file.stem() == "b") throw std::bad_alloc();
  });
  start_service();
  EXPECT_THAT(served(), ElementsAre("c"));
  EXPECT_EQ(client->status().num_unserved_files(), 2U);
}

TEST_F(ServiceWithADirectory, ClosesWhatFinishesAndOpensItAgain) {
  config.finished_open_max = 0;
  make_file("a");
  start_service();
  {
    PlayingWorker worker(endpoint.address());
    worker.deliver(worker.borrow());
    (void)worker.receive<proto::ResultAck>();
    wait_for_event("campaign_closed campaign=a");
    worker.send(test::make_bye());
    wait_for_event("worker_left");
  }
  EXPECT_EQ(client->status().campaigns(0).phase(), proto::CAMPAIGN_PHASE_FINISHED);
  EXPECT_EQ(client->status().campaigns(0).num_done(), 1U);
  EXPECT_EQ(client->error(test::control(proto::CONTROL_ACTION_PAUSE, "a")),
            "campaign = a (is finished)");
  EXPECT_EQ(client->done(test::submission(definition_of(test::campaign_of("a", 3)))),
            "campaign a: active, 3 runs, 1 of them done");
  PlayingWorker worker(endpoint.address(), 1002);
  EXPECT_EQ(worker.borrow(1).first_run(), 1U);
  EXPECT_THAT(served(), ElementsAre("a"));
}

// Somebody computed the campaign elsewhere, and put its file into the directory.
TEST_F(ServiceWithADirectory, ExtendsAClosedCampaignInItsFileWhateverThatIsCalled) {
  make_finished_file("a");
  fs::rename(directory / "a.db", directory / "small.db");
  start_service();
  EXPECT_EQ(client->done(test::submission(definition_of(test::campaign_of("a", 3)))),
            "campaign a: active, 3 runs, 0 of them done");
  EXPECT_THAT(served(), ElementsAre("a"));
  EXPECT_FALSE(fs::exists(directory / "a.db"));
  end(StopRequest::now);
  EXPECT_EQ(Store::open_read_only(directory / "small.db").num_runs(), 3U);
}

// While the directory is looked at, the campaign is submitted that is found there.
TEST_F(ServiceWithADirectory, RemovesAFileThatItMadeForASubmissionInVain) {
  std::promise<void> begun;
  std::promise<void> released;
  std::atomic<int> num_looks = 0;
  make_file("a");
  fs::rename(directory / "a.db", directory / "small.db");
  folder.set_before_load([](const fs::path&) { throw Error("file = small.db (is locked)"); });
  start_service();
  folder.set_before_load([&](const fs::path&) {
    if (num_looks++ > 0) return;
    begun.set_value();
    released.get_future().get();
  });
  begun.get_future().get();
  client->send(100, test::submission(definition_of(test::campaign_of("a", 3))));
  EXPECT_THAT(served(), IsEmpty());  // An answer after the submission was begun.
  released.set_value();
  const proto::ReplyEnvelope reply = client->receive_final();
  EXPECT_EQ(reply.request_id(), 100U);
  EXPECT_EQ(reply.error().text(), "campaign = a in " + (directory / "a.db").string() +
                                      " (is served already, from another file)");
  EXPECT_FALSE(fs::exists(directory / "a.db"));
  EXPECT_TRUE(fs::exists(directory / "small.db"));
  EXPECT_THAT(served(), ElementsAre("a"));
  end(StopRequest::now);
}

// Where ZeroMQ finds no descriptor, it ends the process.
TEST_F(ServiceWithADirectory, OpensNoMoreFilesThanThereAreDescriptorsFor) {
  make_file("a");
  make_finished_file("b");
  const std::uint64_t limit = raise_descriptor_limit();
  config.num_descriptors_reserved = limit - 30;
  start_service();
  const std::string reason =
      "(takes 5 descriptors, for which the coordinator's limit of " + std::to_string(limit) +
      " open files has no room beside other campaigns, workers and clients; raise `ulimit -n` or "
      "LimitNOFILE there)";
  EXPECT_THAT(served(), ElementsAre("b"));
  ASSERT_EQ(client->status().unserved_files_size(), 1);
  EXPECT_EQ(client->status().unserved_files(0).reason(),
            "campaign database = " + (directory / "a.db").string() + " " + reason);
  EXPECT_EQ(client->error(test::submission(definition_of(test::campaign_of("c", 1)))),
            "campaign = c " + reason);
  EXPECT_FALSE(fs::exists(directory / "c.db"));
}

// A file that is open can be copied if it is removed.
TEST_F(ServiceWithADirectory, KeepsTheFilesOpenThatFinishedLast) {
  config.finished_open_max = 1;
  for (const std::string name : {"a", "b", "c"}) make_file(name);
  start_service();
  PlayingWorker worker(endpoint.address());
  (void)worker.register_here();
  for (int i = 0; i < 3; ++i) {
    worker.want(1);
    worker.deliver(worker.receive<proto::RunLease>());
  }
  while (num_events("campaign_summarised") < 3 || num_events("campaign_closed") < 2) {
    std::this_thread::yield();
  }
  int num_open = 0;  // Whose lock the service has.
  for (const std::string name : {"a.db", "b.db", "c.db"}) {
    try {
      (void)Store::open(directory / name);
    } catch (const StoreError&) {
      ++num_open;
    }
  }
  EXPECT_EQ(num_open, 1);
}

TEST_F(ServiceWithADirectory, ServesAnOlderCopyInPlaceOfAFileThatWasClosed) {
  config.finished_open_max = 0;
  make_file("a");
  fs::copy_file(directory / "a.db", directory / "older");
  start_service();
  PlayingWorker worker(endpoint.address());
  worker.deliver(worker.borrow());
  (void)worker.receive<proto::ResultAck>();
  wait_for_event("campaign_closed campaign=a");
  fs::rename(directory / "older", directory / "a.db");
  while (folder.num_loads() < 2) std::this_thread::yield();
  EXPECT_EQ(worker.receive<proto::RunLease>().first_run(), 0U);
  EXPECT_THAT(served(), ElementsAre("a"));
}

TEST_F(ServiceWithADirectory, ListsNoCampaignWhoseFileWasRemoved) {
  make_finished_file("a");
  start_service();
  EXPECT_THAT(served(), ElementsAre("a"));
  fs::remove(directory / "a.db");
  EXPECT_EQ(wait_for_event("campaign_file_gone"),
            "campaign_file_gone file=" + (directory / "a.db").string());
  EXPECT_THAT(served(), IsEmpty());
}

// The copy that is then made of it is the only file of the campaign, and must not be moved away.
TEST_F(ServiceWithADirectory, DoesNotCallTheCopyOfARemovedFileOneTooMany) {
  make_file("a");
  start_service();
  PlayingWorker worker(endpoint.address());
  const proto::RunLease lease = worker.borrow();
  fs::remove(directory / "a.db");
  worker.deliver(lease);
  EXPECT_THAT(wait_for_event("storage_failed"), testing::HasSubstr("a.recovered-"));
  write_bytes(directory / "b.db", "junk");
  wait_for_event("campaign_not_served");
  const proto::StatusReply status = client->status();
  EXPECT_THAT(status.campaigns(0).storage_failure(), testing::HasSubstr("mv --backup"));
  ASSERT_EQ(status.unserved_files_size(), 1);
  EXPECT_EQ(status.unserved_files(0).file(), (directory / "b.db").string());
}

// Otherwise the campaign would be closed without them, and nobody would make them any more.
TEST_F(ServiceWithADirectory, ComputesStatisticsAgainThatADiskPrevented) {
  config.finished_open_max = 0;
  std::atomic<int> num_failures = 0;
  files.before_summary = [&] {
    if (++num_failures <= 3) throw Error("the disk is full");
  };
  make_file("a");
  start_service();
  PlayingWorker worker(endpoint.address());
  worker.deliver(worker.borrow());
  (void)worker.receive<proto::ResultAck>();
  wait_for_event("campaign_closed campaign=a");
  EXPECT_EQ(num_failures, 4);
  EXPECT_EQ(num_events("statistics_failed"), 1);
  EXPECT_EQ(num_events("campaign_summarised"), 1);
  end(StopRequest::now);
}

TEST_F(ServiceWithADirectory, GoesOnWithACancelledCampaignThatItDidNotOpen) {
  {
    ServedCampaign campaign = files.open(test::campaign_of("a", 2), {}, {});
    const coordinator::Entry entry =
        CampaignControl{.phase = wire::CampaignPhase::cancelled, .priority = 4};
    (void)campaign.store.write({&entry, 1});
  }
  start_service();
  EXPECT_EQ(folder.num_loads(), 0);
  EXPECT_EQ(client->done(test::control(proto::CONTROL_ACTION_CANCEL, "a")),
            "campaign a: cancelled, 2 runs, 0 of them done");
  EXPECT_EQ(client->done(test::control(proto::CONTROL_ACTION_RESUME, "a")),
            "campaign a: active, 2 runs, 0 of them done");
  EXPECT_EQ(client->status().campaigns(0).priority(), 4);
  PlayingWorker worker(endpoint.address());
  EXPECT_EQ(worker.borrow(1).first_run(), 0U);
}

TEST_F(ServiceWithADirectory, RetriesRunsOfACampaignThatItDidNotOpen) {
  {
    ServedCampaign campaign = files.open(test::campaign_of("a", 1), {}, {});
    const coordinator::Entry given_up = GivenUpRun{.run = {0}};
    (void)campaign.store.write({&given_up, 1});
    const coordinator::Entry finished = CampaignControl{.phase = wire::CampaignPhase::finished};
    (void)campaign.store.write({&finished, 1});
  }
  start_service();
  EXPECT_EQ(folder.num_loads(), 0);
  EXPECT_EQ(client->done(test::control(proto::CONTROL_ACTION_RETRY, "a")),
            "campaign a: active, 1 runs, 0 of them done");
  PlayingWorker worker(endpoint.address());
  EXPECT_EQ(worker.borrow(1).first_run(), 0U);
}

// A coordinator that ended has compared them. One of the files is opened, of the other one it is
// enough that it has ended.
TEST_F(ServiceWithADirectory, TellsOfContradictionsThatWereFoundBefore) {
  make_file("a");
  make_file("b");
  execute("a",
          "INSERT INTO audit VALUES (0, 1, 0, 'aaaaaaaaaaaaaaaa', 'bbbbbbbbbbbbbbbb', 0), (0, 2, "
          "1, 'aaaaaaaaaaaaaaaa', 'aaaaaaaaaaaaaaaa', 0)");
  execute("b", "INSERT INTO audit VALUES (0, 1, 0, 'aaaaaaaaaaaaaaaa', 'bbbbbbbbbbbbbbbb', 0)");
  change_file("b", "phase = 'cancelled'");
  start_service();
  const proto::StatusReply status = client->status();
  ASSERT_EQ(status.campaigns_size(), 2);
  for (const proto::CampaignStatus& campaign : status.campaigns()) {
    EXPECT_EQ(campaign.num_audited(), campaign.name() == "a" ? 2U : 1U);
    EXPECT_EQ(campaign.num_mismatches(), 1U);
  }
}

TEST_F(ServiceWithADirectory, ArchivesACampaignOnceItsStatisticsAreThere) {
  std::promise<void> begun;
  std::promise<void> released;
  files.before_summary = [&] {
    begun.set_value();
    released.get_future().get();
  };
  make_file("a");
  start_service();
  PlayingWorker worker(endpoint.address());
  worker.deliver(worker.borrow());
  begun.get_future().get();
  client->send(100, test::control(proto::CONTROL_ACTION_ARCHIVE, "a"));
  EXPECT_THAT(served(), ElementsAre("a"));
  released.set_value();
  const proto::ReplyEnvelope reply = client->receive_final();
  EXPECT_EQ(reply.request_id(), 100U);
  EXPECT_THAT(reply.done().text(), testing::StartsWith("campaign a: its database is"));
}

// Who reads the newest state is in nobody's way until the end of the service is written down.
TEST_F(ServiceWithADirectory, ArchivesNoFileThatSomebodyReads) {
  make_file("a");
  start_service();
  PlayingWorker worker(endpoint.address());
  worker.deliver(worker.borrow());
  (void)worker.receive<proto::ResultAck>();
  wait_for_event("campaign_summarised");
  const fs::path file = directory / "a.db";
  while (has_journal(file)) std::this_thread::yield();
  sqlite3* reader = nullptr;
  ASSERT_EQ(sqlite3_open_v2(file.c_str(), &reader, SQLITE_OPEN_READONLY, nullptr), SQLITE_OK);
  const char* const read = "BEGIN; SELECT * FROM campaign";
  ASSERT_EQ(sqlite3_exec(reader, read, nullptr, nullptr, nullptr), SQLITE_OK);
  const proto::RequestEnvelope archive = test::control(proto::CONTROL_ACTION_ARCHIVE, "a");
  EXPECT_EQ(client->error(archive),
            "campaign = a (its database is being read or changed; try again)");
  EXPECT_TRUE(fs::exists(file));
  sqlite3_close(reader);
  while (client->done(archive).starts_with("error")) std::this_thread::yield();
  EXPECT_EQ(Store::open_read_only(directory / "a.archived").finished_runs().size(), 1U);
  EXPECT_FALSE(has_journal(file));
  // Its runs would all be computed again, into another file of that name.
  EXPECT_EQ(client->error(test::submission(definition_of(test::campaign_of("a", 2)))),
            "campaign = a (is archived/a.db: move it back for more runs, or choose another name)");
}

// The names say the opposite.
TEST_F(ServiceWithADirectory, ListsCampaignsInTheOrderInWhichTheyWereMade) {
  for (const auto& [name, year] : {std::pair{"c", 2021}, {"a", 2023}, {"b", 2022}}) {
    make_file(name);
    change_file(name, "created_utc = '" + std::to_string(year) + "-01-01T00:00:00Z'");
  }
  start_service();
  EXPECT_THAT(served(), ElementsAre("c", "b", "a"));
}

// Another program may have made the file. Clients refuse a list with such a name as a whole.
TEST_F(ServiceWithADirectory, ShowsTheOthersBesideACampaignWhoseNamesBreakTheRules) {
  for (const auto& [name, assignment] : {std::pair{"a", "name = 'a b'"},
                                         {"b", "name = ''"},
                                         {"c", "owner = 'x/y'"},
                                         {"d", "priority = 1000"}}) {
    make_file(name);
    change_file(name, assignment);
    make_finished_file(name + std::string("-ended"));
    change_file(name + std::string("-ended"), assignment);
  }
  make_file("good");
  start_service();
  EXPECT_THAT(served(), ElementsAre("good"));
  const proto::StatusReply status = client->status();
  ASSERT_EQ(status.unserved_files_size(), 8);
  for (const proto::UnservedFile& file : status.unserved_files()) {
    EXPECT_THAT(file.reason(), testing::HasSubstr("its name, owner or priority breaks the rules"));
  }
}

}  // namespace
}  // namespace proofmass::coordinator
