#include "coordinator/net/background.hpp"
#include "coordinator/net/campaign_files.hpp"
#include "coordinator/net/campaign_service.hpp"
#include "coordinator/net/server_paths.hpp"
#include "coordinator/net/worker_gateway.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "proto/link/machine.hpp"
#include "proto/proofmass.pb.h"
#include "proto/wire/client_codec.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

using wire::WorkerId;

Address at(const std::string& routing_id, const std::string& key = "") {
  return {.routing_id = routing_id, .key = key, .host = {}};
}

TEST(Peers, GiveEachSessionAWorkerOfItsOwn) {
  Peers peers;
  EXPECT_EQ(peers.meet({11}, 1, at("a")), WorkerId{1});
  EXPECT_EQ(peers.meet({12}, 1, at("b")), WorkerId{2});
  EXPECT_EQ(peers.meet({11}, 2, at("a")), WorkerId{1});
  EXPECT_EQ(peers.worker_of({12}), WorkerId{2});
  EXPECT_EQ(peers.workers(), (std::vector<WorkerId>{{1}, {2}}));
}

TEST(Peers, FollowASessionToItsNewConnection) {
  Peers peers;
  (void)peers.meet({11}, 1, at("a"));
  EXPECT_EQ(peers.meet({11}, 2, at("b")), WorkerId{1});
  EXPECT_EQ(peers.address_of({1})->routing_id, "b");
  EXPECT_EQ(peers.worker_at("a"), std::nullopt);
  EXPECT_EQ(peers.worker_at("b"), WorkerId{1});
}

// What was under way on the connection that broke is read after the first words on the new one.
TEST(Peers, DoNotFollowAMessageOfAConnectionThatWasLeft) {
  Peers peers;
  (void)peers.meet({11}, 5, at("a"));
  (void)peers.meet({11}, 7, at("b"));
  EXPECT_EQ(peers.meet({11}, 6, at("a")), WorkerId{1});
  EXPECT_EQ(peers.address_of({1})->routing_id, "b");
}

TEST(Peers, LetNoOtherKeyTakeASession) {
  Peers peers;
  (void)peers.meet({11}, 1, at("a", "key"));
  EXPECT_EQ(peers.meet({11}, 2, at("b", "other")), std::nullopt);
  EXPECT_EQ(peers.address_of({1})->routing_id, "a");
}

TEST(Peers, LetNoConnectionHaveTwoSessions) {
  Peers peers;
  (void)peers.meet({11}, 1, at("a"));
  (void)peers.meet({13}, 1, at("c"));
  EXPECT_EQ(peers.meet({12}, 1, at("a")), std::nullopt);
  EXPECT_EQ(peers.meet({13}, 2, at("a")), std::nullopt);
  EXPECT_EQ(peers.worker_of({12}), std::nullopt);
  EXPECT_EQ(peers.address_of({2})->routing_id, "c");
}

TEST(Peers, NumberTheMessagesToEachWorker) {
  Peers peers;
  (void)peers.meet({11}, 1, at("a"));
  (void)peers.meet({12}, 1, at("b"));
  proto::Envelope message;
  peers.address({1}, message);
  EXPECT_EQ(message.session(), 11U);
  EXPECT_EQ(message.sequence(), 1U);
  peers.address({1}, message);
  EXPECT_EQ(message.sequence(), 2U);
  peers.address({2}, message);
  EXPECT_EQ(message.sequence(), 1U);
}

TEST(Peers, ForgetAWorkerAltogether) {
  Peers peers;
  (void)peers.meet({11}, 1, at("a"));
  peers.forget({1});
  EXPECT_EQ(peers.address_of({1}), nullptr);
  EXPECT_EQ(peers.worker_at("a"), std::nullopt);
  EXPECT_EQ(peers.meet({11}, 1, at("a")), WorkerId{2});
}

TEST(Peers, ForgetStrangersOnceThereAreTooMany) {
  Peers peers({.peers_max = 3, .closed_out_max = 2});
  (void)peers.meet({11}, 1, at("a"));
  (void)peers.meet({12}, 1, at("b"));
  const auto is_first = [](WorkerId worker) { return worker == WorkerId{1}; };
  peers.limit(is_first);
  EXPECT_EQ(peers.workers().size(), 2U);
  (void)peers.meet({13}, 1, at("c"));
  peers.limit(is_first);
  EXPECT_EQ(peers.workers(), std::vector<WorkerId>{{1}});
}

TEST(Peers, RememberWhoWasClosedOutUpToALimit) {
  Peers peers({.peers_max = 3, .closed_out_max = 2});
  peers.close_out("a");
  peers.close_out("b");
  EXPECT_TRUE(peers.is_closed_out("a"));
  peers.close_out("c");
  EXPECT_FALSE(peers.is_closed_out("a"));
  EXPECT_TRUE(peers.is_closed_out("c"));
}

TEST(PeerAddress, IsWrittenForPeople) {
  EXPECT_EQ(to_text(fields_of({.routing_id = "\1", .key = "abc", .host = "10.0.0.7"})),
            "address=10.0.0.7 key=abc");
  EXPECT_EQ(to_text(fields_of({.routing_id = "\1", .key = "", .host = ""})),
            "address=unknown key=none");
}

TEST(Background, TakesNoMoreThanMayWait) {
  std::promise<void> gate;
  Background background([] {});
  const auto wait = [opened = gate.get_future().share()]() -> Background::Finish {
    opened.wait();
    return [] {};
  };
  for (std::size_t i = 0; i < Background::num_pending_max; ++i) EXPECT_TRUE(background.post(wait));
  EXPECT_FALSE(background.post(wait));
  gate.set_value();
}

StopPlan plan_with_rule() {
  return {.stop_rule = "mean(k2c) within 5%", .num_runs_max = {}, .failures_max = {}};
}

TEST(HorizonOf, WithoutARuleIsWhatIsAskedFor) {
  EXPECT_EQ(horizon_of({}, 1000, 0), 1000U);
  EXPECT_EQ(horizon_of({}, 1000, 10), 1000U);
}

// 128 runs first, then 192 and 256.
TEST(HorizonOf, IsTheNextCheckOfTheRule) {
  EXPECT_EQ(horizon_of(plan_with_rule(), 1000, 0), 128U);
  EXPECT_EQ(horizon_of(plan_with_rule(), 1000, 100), 128U);
  EXPECT_EQ(horizon_of(plan_with_rule(), 1000, 129), 192U);
}

// A file may have been left before the rule was checked.
TEST(HorizonOf, OfARunCountThatIsACheckIsThatCheck) {
  EXPECT_EQ(horizon_of(plan_with_rule(), 1000, 128), 128U);
  EXPECT_EQ(horizon_of(plan_with_rule(), 1000, 192), 192U);
}

TEST(HorizonOf, IsNotBeyondWhatIsAskedFor) {
  EXPECT_EQ(horizon_of(plan_with_rule(), 100, 0), 100U);
  EXPECT_EQ(horizon_of(plan_with_rule(), 150, 140), 150U);
  EXPECT_EQ(horizon_of(plan_with_rule(), 50, 100), 50U);  // Which is refused where it is wanted.
}

TEST(ServerPaths, NameFilesWithinTheDirectoryOfCampaigns) {
  const ServerPaths paths("my data/served");
  const std::string whole = std::filesystem::absolute("my data/served").string();
  EXPECT_EQ(paths.hidden_in("campaign database = my data/served/a.db (is locked)"),
            "campaign database = a.db (is locked)");
  EXPECT_EQ(paths.hidden_in(whole + "/a.db: it is " + whole + "/archived/a.db now"),
            "a.db: it is archived/a.db now");
}

// Which are those of a client's own words.
TEST(ServerPaths, LeaveOtherPathsAsTheyAre) {
  const std::string text = "option = /etc/shadow, observed/a.db, 3 m/s\u00b2 (1/2, tcp://*:5556)";
  for (const ServerPaths& paths : {ServerPaths("served"), ServerPaths("")}) {
    EXPECT_EQ(paths.hidden_in(text), text);
  }
}

TEST(ServerPaths, AreInNoReply) {
  const ServerPaths paths("served");
  proto::ReplyEnvelope reply;
  proto::StatusReply& shown = *reply.mutable_status();
  shown.add_campaigns()->set_storage_failure("file = served/a.db (full)");
  shown.add_unserved_files()->set_file("served/b.db");
  shown.mutable_unserved_files(0)->set_reason("file = served/b.db (locked)");
  paths.hide_in(reply);
  EXPECT_EQ(shown.campaigns(0).storage_failure(), "file = a.db (full)");
  EXPECT_EQ(shown.unserved_files(0).file(), "b.db");
  EXPECT_EQ(shown.unserved_files(0).reason(), "file = b.db (locked)");
  proto::ReplyEnvelope error = wire::error_reply("file = served/b.db (locked)");
  paths.hide_in(error);
  EXPECT_EQ(error.error().text(), "file = b.db (locked)");
  error = wire::error_reply(
      "campaign database = served/.answers/copy-1.db (the disk is full; free space and try again)");
  paths.hide_in(error);
  EXPECT_EQ(error.error().text(), "disk of the coordinator's host " + wire::host_name() +
                                      " = full (what was stored before is safe; free space there "
                                      "and try again)");
}

using std::chrono::hours;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr TimePoint zero_hour{hours(5)};

TEST(WakingTime, IsThatOfTheClockWhileTheProcessIsAwake) {
  WakingTime time(zero_hour);
  EXPECT_EQ(time.at(zero_hour), zero_hour);
  EXPECT_EQ(time.at(zero_hour + milliseconds(100)), zero_hour + milliseconds(100));
  EXPECT_EQ(time.at(zero_hour + milliseconds(600)), zero_hour + milliseconds(600));
}

TEST(WakingTime, LeavesOutWhatIsLongerThanAGap) {
  WakingTime time(zero_hour);
  EXPECT_EQ(time.at(zero_hour + hours(1)), zero_hour + WakingTime::gap_max);
  EXPECT_EQ(time.at(zero_hour + hours(1) + milliseconds(100)),
            zero_hour + WakingTime::gap_max + milliseconds(100));
  EXPECT_EQ(time.at(zero_hour + hours(2)), zero_hour + 2 * WakingTime::gap_max + milliseconds(100));
}

TEST(RateMeter, LeavesOutTheTimeInWhichNothingIsLent) {
  RateMeter meter(zero_hour);
  EXPECT_EQ(meter.rate_hz(zero_hour), 0.0);
  meter.wait(zero_hour + seconds(50));
  EXPECT_EQ(meter.rate_hz(zero_hour + seconds(50)), 0.0);
  meter.add(0, zero_hour + seconds(55));
  meter.add(30, zero_hour + seconds(60));
  EXPECT_EQ(meter.rate_hz(zero_hour + seconds(60)), 3.0);
  meter.wait(zero_hour + seconds(90));
  EXPECT_EQ(meter.rate_hz(zero_hour + seconds(90)), 3.0);
}

TEST(RateMeter, ForgetsWhatIsOlderThanTwoMinutes) {
  RateMeter meter(zero_hour);
  meter.add(1000, zero_hour + seconds(1));
  meter.wait(zero_hour + seconds(190));
  meter.add(20, zero_hour + seconds(200));
  EXPECT_EQ(meter.rate_hz(zero_hour + seconds(200)), 2.0);
  EXPECT_EQ(meter.rate_hz(zero_hour + seconds(400)), 0.0);
}

// Its memory does not grow with the number of commits.
TEST(RateMeter, CountsAllOfASecondTogether) {
  RateMeter meter(zero_hour);
  for (int i = 0; i < 1000; ++i) meter.add(2, zero_hour + milliseconds(i));
  meter.add(0, zero_hour + seconds(10));
  EXPECT_EQ(meter.rate_hz(zero_hour + seconds(10)), 200.0);
}

std::shared_ptr<const Campaign> definition(std::uint64_t num_runs) {
  MicroscopeCampaign campaign;
  campaign.num_runs = num_runs;
  return std::make_shared<const MicroscopeCampaign>(campaign);
}

std::size_t encoded_size(const Campaign& campaign) {
  return wire::encode_definition(campaign.definition(TableColumns::included)).size();
}

TEST(DefinitionCache, EncodesADefinitionOnceForAllWorkers) {
  DefinitionCache cache;
  const auto one = definition(10);
  for (int i = 0; i < 300; ++i) (void)cache.part({1}, 0, one);
  EXPECT_EQ(cache.num_encoded(), 1U);
  EXPECT_EQ(cache.size(), encoded_size(*one));
}

TEST(DefinitionCache, EncodesAnExtendedCampaignAgain) {
  DefinitionCache cache;
  const auto before = cache.part({1}, 0, definition(10));
  const auto after = cache.part({1}, 0, definition(11));
  EXPECT_NE(before.checksum(), after.checksum());
  EXPECT_EQ(cache.num_encoded(), 2U);
  EXPECT_EQ(cache.size(), after.total_size());
}

// Workers get the values of the tables with each lease.
TEST(DefinitionCache, LeavesOutTheColumns) {
  MicroscopeCampaign campaign;
  campaign.dispersions[5] = {.law = Law::table, .file = "f.csv", .column = "a"};
  campaign.table_columns = {std::vector<double>(campaign.num_runs, 1e-3)};
  DefinitionCache cache;
  const proto::DefinitionPart part =
      cache.part({1}, 0, std::make_shared<const MicroscopeCampaign>(campaign));
  wire::IncomingDefinition incoming;
  ASSERT_EQ(incoming.add(part), wire::IncomingDefinition::Progress::complete);
  const Definition taken = incoming.take();
  EXPECT_TRUE(taken.table_columns.empty());
  EXPECT_EQ(taken, definition_of(campaign, TableColumns::left_out));
}

TEST(DefinitionCache, KeepsThoseThatWereUsedLast) {
  const auto one = definition(10);
  const std::size_t size = encoded_size(*one);
  DefinitionCache cache(2 * size - 1);
  const auto ask = [&](std::uint64_t id) {
    (void)cache.part({id}, 0, one);
    return cache.num_encoded();
  };
  EXPECT_EQ(ask(1), 1U);
  EXPECT_EQ(ask(2), 2U);
  EXPECT_EQ(ask(1), 2U);
  EXPECT_EQ(ask(3), 3U) << "the second makes room";
  EXPECT_EQ(ask(1), 3U);
  EXPECT_EQ(ask(2), 4U);
  EXPECT_LE(cache.size(), 2 * size);
}

}  // namespace
}  // namespace proofmass::coordinator
