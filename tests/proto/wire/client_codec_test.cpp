#include "proto/wire/client_codec.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <random>

#include "core/error.hpp"
#include "proto/wire/names.hpp"
#include "tests/proto/wire/requests.hpp"

namespace proofmass::wire {
namespace {

constexpr std::uint64_t some_id = 0xfedc'ba98'7654'3210;

proto::RequestEnvelope round_trip(const proto::RequestEnvelope& request) {
  auto decoded = decode_request(encode(test::numbered(some_id, request)));
  if (const auto* const error = std::get_if<DecodeError>(&decoded)) throw Error(error->text);
  EXPECT_EQ(std::get<proto::RequestEnvelope>(decoded).request_id(), some_id);
  return std::get<proto::RequestEnvelope>(std::move(decoded));
}

proto::ReplyEnvelope round_trip(const proto::ReplyEnvelope& reply) {
  auto decoded = decode_reply(encode(test::numbered(some_id, reply)));
  if (const auto* const error = std::get_if<DecodeError>(&decoded)) throw Error(error->text);
  EXPECT_EQ(std::get<proto::ReplyEnvelope>(decoded).request_id(), some_id);
  return std::get<proto::ReplyEnvelope>(std::move(decoded));
}

StatusReply round_trip(const StatusReply& status) {
  return read(round_trip(test::reply_with(status)).status());
}

WorkersReply round_trip(const WorkersReply& workers) {
  return read(round_trip(test::reply_with(workers)).workers());
}

Definition some_definition() {
  return {.text = "[campaign]\nname = \"Δ\"\n",
          .tables = {{.key = "environment.file",
                      .num_columns = 2,
                      .values = {0.1, -0.0, 1e-300, std::numeric_limits<double>::max()}}},
          .table_columns = {{0.1, -2.0 / 3.0}, {1e-3, std::numeric_limits<double>::denorm_min()}}};
}

TEST(SubmitRequest, KeepsTheDefinition) {
  proto::RequestEnvelope request = round_trip(test::submission(some_definition()));
  const Definition definition = take_definition(*request.mutable_submit());
  EXPECT_EQ(definition, some_definition());
  EXPECT_TRUE(std::signbit(definition.tables[0].values[1]));
  EXPECT_FALSE(request.submit().has_definition());
}

CampaignStatus some_status() {
  return {.name = "a",
          .phase = CampaignPhase::paused,
          .priority = -3,
          .num_runs = 100,
          .num_done = 11,
          .num_without_estimate = 2,
          .num_given_up = 3,
          .num_lent = 4,
          .num_duplicates = 5,
          .num_audited = 6,
          .num_mismatches = 7,
          .rate_hz = 0.1,
          .remaining_s = 0.2,
          .storage_failure = "disk full"};
}

CampaignStatus status_named(const std::string& name) {
  CampaignStatus status;
  status.name = name;
  status.num_runs = 1;
  return status;
}

StatusReply reply_with(const std::vector<CampaignStatus>& campaigns) {
  StatusReply reply;
  reply.version = "v";
  reply.model_version = "m";
  reply.campaigns = campaigns;
  return reply;
}

FactoryReport some_report() {
  return {.name = "fleet",
          .batch_system = "pbs",
          .phase = FactoryPhase::waiting,
          .num_wanted = 4,
          .num_registered = 3,
          .num_queued = 2,
          .wait_s = 59.5,
          .reason = "qsub: queue full",
          .interval_s = 30};
}

void expect_some_report(const FactoryReport& report) {
  EXPECT_EQ(report.name, "fleet");
  EXPECT_EQ(report.batch_system, "pbs");
  EXPECT_EQ(report.phase, FactoryPhase::waiting);
  EXPECT_EQ(report.num_wanted, 4U);
  EXPECT_EQ(report.num_registered, 3U);
  EXPECT_EQ(report.num_queued, 2U);
  EXPECT_EQ(report.wait_s, 59.5);
  EXPECT_EQ(report.reason, "qsub: queue full");
  EXPECT_EQ(report.interval_s, 30U);
}

TEST(FactoryReport, KeepsEverything) {
  expect_some_report(read(round_trip(test::request_of(some_report())).factory_report()));
}

// The words of a batch system may be in any language and of any length.
TEST(FactoryReport, IsSentWithoutWhatATerminalWouldObey) {
  FactoryReport report = some_report();
  report.reason = "\x1b[2J" + std::string(5000, 'x');
  EXPECT_EQ(round_trip(test::request_of(report)).factory_report().reason(),
            "?[2J" + std::string(4092, 'x'));
}

TEST(RequestPart, OfTheLargestSizeFitsIntoAMessage) {
  const proto::RequestPart part =
      test::part(submit_size_max, submit_size_max - request_part_size_max,
                 std::string(request_part_size_max, 'x'));
  const std::string bytes = encode(test::numbered(~std::uint64_t{0}, test::request_of(part)));
  EXPECT_LE(bytes.size(), request_message_size_max);
  EXPECT_TRUE(std::holds_alternative<proto::RequestEnvelope>(decode_request(bytes)));
}

TEST(StatusReply, SaysWhatIsAmissAndHowMuchThereIs) {
  StatusReply sent{.version = "v", .model_version = "m", .campaigns = {}};
  sent.num_campaigns = 1000;
  sent.unserved_files = {{.file = "a.db", .reason = "is locked"}};
  sent.num_unserved_files = 70;
  sent.quarantined_hosts = {"n7"};
  sent.num_quarantined_hosts = 300;
  const StatusReply status = round_trip(sent);
  EXPECT_EQ(status.num_campaigns, 1000U);
  ASSERT_EQ(status.unserved_files.size(), 1U);
  EXPECT_EQ(status.unserved_files[0].file, "a.db");
  EXPECT_EQ(status.unserved_files[0].reason, "is locked");
  EXPECT_EQ(status.num_unserved_files, 70U);
  EXPECT_EQ(status.quarantined_hosts, std::vector<std::string>{"n7"});
  EXPECT_EQ(status.num_quarantined_hosts, 300U);
}

// One campaign, host or factory must not make a reply about all of them unreadable.
TEST(Replies, AreReadableWhateverTheySay) {
  std::mt19937_64 random(38);
  const auto below = [&](std::uint64_t end) { return random() % end; };
  const auto text = [&] {
    constexpr std::array lengths{0, 1, 7, 128, 129, 5000};
    std::string any(static_cast<std::size_t>(lengths.at(below(lengths.size()))), ' ');
    for (char& c : any) c = static_cast<char>(below(256));
    return any;
  };
  const auto number = [&] {
    constexpr double infinite = std::numeric_limits<double>::infinity();
    constexpr std::array numbers{0.0, -0.0, 2.5, -1.0, infinite, -infinite, 1e300};
    return below(9) == 0 ? std::nan("") : numbers.at(below(numbers.size()));
  };
  const auto count = [&] { return random() >> below(64); };
  for (int i = 0; i < 500; ++i) {
    StatusReply status{.version = "v", .model_version = "m", .uptime_s = number(), .campaigns = {}};
    status.campaigns.push_back({.name = text(),
                                .phase = static_cast<CampaignPhase>(1 + below(4)),
                                .priority = static_cast<int>(random()),
                                .num_runs = count(),
                                .num_done = count(),
                                .num_given_up = count(),
                                .rate_hz = number(),
                                .remaining_s = number(),
                                .storage_failure = text(),
                                .owner = text()});
    status.unserved_files = {{text(), text()}};
    status.quarantined_hosts = {text()};
    const FactoryReport report{
        .name = text(), .batch_system = text(), .wait_s = number(), .reason = text()};
    status.factories = {{.report = report, .owner = text(), .silent_s = number()}};
    EXPECT_NO_THROW((void)round_trip(status));
    const WorkerStatus worker{
        .id = {1 + below(9)}, .name = text(), .host = text(), .silent_s = number()};
    EXPECT_NO_THROW((void)round_trip(WorkersReply{.workers = {worker}, .num_workers = 1}));
    EXPECT_NO_THROW((void)round_trip(done_reply(text())));
    EXPECT_NO_THROW((void)round_trip(error_reply(text())));
    proto::ReplyEnvelope answer;
    answer.mutable_answer()->set_answer_id(1);
    answer.mutable_answer()->set_sha256(std::string(64, '0'));
    answer.mutable_answer()->set_exit_code(255);
    answer.mutable_answer()->set_error_text(text());
    EXPECT_NO_THROW((void)round_trip(answer));
  }
}

TEST(StatusReply, KeepsFactories) {
  StatusReply sent = reply_with({});
  sent.factories = {{.report = some_report(), .owner = "anna", .silent_s = 1.5},
                    {.report = some_report()}};
  const StatusReply status = round_trip(sent);
  ASSERT_EQ(status.factories.size(), 2U);
  expect_some_report(status.factories[0].report);
  EXPECT_EQ(status.factories[0].owner, "anna");
  EXPECT_EQ(status.factories[0].silent_s, 1.5);
  EXPECT_EQ(status.factories[1].owner, "");
}

TEST(StatusReply, KeepsEverything) {
  const auto status = round_trip(StatusReply{.version = "0.1.0",
                                             .model_version = "m-2",
                                             .uptime_s = 0.3,
                                             .num_workers = 8,
                                             .num_slots = 9,
                                             .campaigns = {some_status(), status_named("b")}});
  EXPECT_EQ(status.version, "0.1.0");
  EXPECT_EQ(status.model_version, "m-2");
  EXPECT_EQ(status.uptime_s, 0.3);
  EXPECT_EQ(status.num_workers, 8U);
  EXPECT_EQ(status.num_slots, 9U);
  ASSERT_EQ(status.campaigns.size(), 2U);
  EXPECT_EQ(status.campaigns[1].name, "b");
  EXPECT_EQ(status.campaigns[1].remaining_s, std::nullopt);
}

TEST(StatusReply, KeepsACampaign) {
  const CampaignStatus sent = some_status();
  const CampaignStatus campaign = round_trip(reply_with({sent})).campaigns.at(0);
  EXPECT_EQ(campaign.name, sent.name);
  EXPECT_EQ(campaign.phase, sent.phase);
  EXPECT_EQ(campaign.priority, sent.priority);
  for (const CampaignCounter& counter : campaign_counters) {
    EXPECT_EQ(campaign.*counter.count, sent.*counter.count) << counter.name;
  }
  EXPECT_EQ(campaign.rate_hz, sent.rate_hz);
  EXPECT_EQ(campaign.remaining_s, sent.remaining_s);
  EXPECT_EQ(campaign.storage_failure, sent.storage_failure);
}

TEST(StatusReply, MayNameAsManyCampaignsAsAreServed) {
  const std::vector<CampaignStatus> campaigns(campaigns_per_reply_max, some_status());
  EXPECT_EQ(round_trip(reply_with(campaigns)).campaigns.size(), campaigns_per_reply_max);
}

TEST(StatusReply, HasRoomForAllThatItMayName) {
  const std::string name(128, 'x');
  const std::string text(reply_text_size_max, 'x');
  CampaignStatus campaign = some_status();
  campaign.name = campaign.owner = name;
  campaign.storage_failure = text;
  StatusReply full = reply_with(std::vector<CampaignStatus>(campaigns_per_reply_max, campaign));
  full.unserved_files.assign(unserved_files_per_reply_max, {.file = text, .reason = text});
  full.quarantined_hosts.assign(quarantined_hosts_per_reply_max, name);
  FactoryReport report = some_report();
  report.name = report.batch_system = name;
  report.reason = text;
  full.factories.assign(factories_max, {.report = report, .owner = name});
  EXPECT_EQ(round_trip(full).factories.size(), factories_max);
}

TEST(WorkersReply, KeepsEverything) {
  const WorkerStatus sent{.id = {3},
                          .name = "w",
                          .host = "h",
                          .process_id = 4,
                          .num_slots = 5,
                          .num_lent = 6,
                          .num_results = 7,
                          .silent_s = 0.1,
                          .is_quarantined = true};
  const auto reply =
      round_trip(WorkersReply{.workers = {sent, {.id = {4}, .name = "x", .host = "y"}}});
  ASSERT_EQ(reply.workers.size(), 2U);
  const WorkerStatus& worker = reply.workers[0];
  EXPECT_EQ(worker.id, sent.id);
  EXPECT_EQ(worker.name, sent.name);
  EXPECT_EQ(worker.host, sent.host);
  EXPECT_EQ(worker.process_id, sent.process_id);
  EXPECT_EQ(worker.num_slots, sent.num_slots);
  EXPECT_EQ(worker.num_lent, sent.num_lent);
  EXPECT_EQ(worker.num_results, sent.num_results);
  EXPECT_EQ(worker.silent_s, sent.silent_s);
  EXPECT_TRUE(worker.is_quarantined);
  EXPECT_FALSE(reply.workers[1].is_quarantined);
}

TEST(TextReplies, KeepTheirText) {
  EXPECT_EQ(round_trip(done_reply("done\nwell")).done().text(), "done\nwell");
}

// A text may hold the path of a file, which may hold anything.
TEST(TextReplies, AreSentWithoutWhatATerminalWouldObey) {
  const std::string text =
      "a\x1b[2Jb\tc\xff"
      "d";
  EXPECT_EQ(round_trip(error_reply(text)).error().text(), "a?[2Jb?c?d");
}

TEST(TextReplies, AreCutToTheirLimit) {
  EXPECT_EQ(round_trip(done_reply(std::string(5000, 'x'))).done().text(), std::string(4096, 'x'));
}

TEST(Reply, MayAnswerARequestThatCouldNotBeRead) {
  const auto decoded = decode_reply(encode(error_reply("x")));
  EXPECT_EQ(std::get<proto::ReplyEnvelope>(decoded).request_id(), 0U);
}

TEST(Request, OfTooManyBytesIsNotMade) {
  Definition definition = some_definition();
  definition.table_columns = {std::vector<double>(std::size_t{1} << 23), {}};
  try {
    (void)encode(test::submission(definition));
    FAIL();
  } catch (const InvalidArgument& error) {
    const std::string text = error.what();
    EXPECT_EQ(text.substr(0, 15), "request size = ");
    EXPECT_EQ(text.substr(text.find('(')), "(must be at most 67108864)");
  }
}

TEST(ClientNames, AreThoseOfTheEnumerators) {
  EXPECT_EQ(name_of(ControlAction::pause), "pause");
  EXPECT_EQ(name_of(ControlAction::resume), "resume");
  EXPECT_EQ(name_of(ControlAction::cancel), "cancel");
  EXPECT_EQ(name_of(ControlAction::set_priority), "set-priority");
  EXPECT_EQ(name_of(ControlAction::retry), "retry");
  EXPECT_EQ(name_of(CampaignPhase::active), "active");
  EXPECT_EQ(name_of(CampaignPhase::paused), "paused");
  EXPECT_EQ(name_of(CampaignPhase::finished), "finished");
  EXPECT_EQ(name_of(CampaignPhase::cancelled), "cancelled");
  EXPECT_EQ(name_of(FactoryPhase::active), "active");
  EXPECT_EQ(name_of(FactoryPhase::waiting), "waiting");
  EXPECT_EQ(name_of(FactoryPhase::paused), "paused");
}

}  // namespace
}  // namespace proofmass::wire
