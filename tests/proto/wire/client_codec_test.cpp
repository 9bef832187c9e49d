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

proto::StatusReply round_trip(const proto::StatusReply& status) {
  return round_trip(test::reply_with(status)).status();
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

proto::CampaignStatus some_status() {
  proto::CampaignStatus campaign =
      test::campaign_status("a", 11, 100, proto::CAMPAIGN_PHASE_PAUSED);
  campaign.set_priority(-3);
  campaign.set_num_given_up(3);
  campaign.set_num_mismatches(7);
  campaign.set_rate_hz(0.1);
  campaign.set_remaining_s(0.2);
  campaign.set_storage_failure("disk full");
  return campaign;
}

proto::FactoryReport some_report() {
  proto::FactoryReport report = test::factory_report("fleet", 30, proto::FACTORY_PHASE_WAITING);
  report.set_wait_s(59.5);
  report.set_reason("qsub: queue full");
  return report;
}

// The words of a batch system may be in any language and of any length.
TEST(FactoryReport, IsSentWithoutWhatATerminalWouldObey) {
  proto::FactoryReport report = some_report();
  report.set_reason("\x1b[2J" + std::string(5000, 'x'));
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
    proto::CampaignStatus campaign = test::campaign_status(
        text(), count(), count(), static_cast<proto::CampaignPhase>(1 + below(4)));
    campaign.set_priority(static_cast<int>(random()));
    campaign.set_num_given_up(count());
    campaign.set_rate_hz(number());
    campaign.set_remaining_s(number());
    campaign.set_storage_failure(text());
    campaign.set_owner(text());
    proto::StatusReply status = test::status_with({campaign});
    status.set_uptime_s(number());
    status.add_unserved_files()->set_file(text());
    status.mutable_unserved_files(0)->set_reason(text());
    status.add_quarantined_hosts(text());
    proto::FactoryReport report = test::factory_report(text(), 30);
    report.set_batch_system(text());
    report.set_wait_s(number());
    report.set_reason(text());
    proto::FactoryStatus& factory = *status.add_factories();
    *factory.mutable_report() = report;
    factory.set_owner(text());
    factory.set_silent_s(number());
    EXPECT_NO_THROW((void)round_trip(status));
    EXPECT_NO_THROW((void)round_trip(test::request_of(report)));
    proto::WorkerStatus worker = test::worker_status(1 + below(9), text(), text());
    worker.set_silent_s(number());
    EXPECT_NO_THROW((void)round_trip(test::reply_with({worker})));
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

// encode() changes only what may not be sent.
TEST(StatusReply, KeepsEverything) {
  proto::StatusReply sent = test::status_with({some_status(), test::campaign_status("b", 0, 1)});
  sent.set_num_campaigns(1000);
  sent.add_unserved_files()->set_file("a.db");
  sent.mutable_unserved_files(0)->set_reason("is locked");
  sent.set_num_unserved_files(70);
  sent.add_quarantined_hosts("n7");
  *sent.add_factories()->mutable_report() = some_report();
  *sent.add_factories()->mutable_report() = some_report();
  sent.mutable_factories(0)->set_owner("anna");
  EXPECT_EQ(round_trip(sent).SerializeAsString(), sent.SerializeAsString());
}

TEST(StatusReply, MayNameAsManyCampaignsAsAreServed) {
  const std::vector<proto::CampaignStatus> campaigns(campaigns_per_reply_max, some_status());
  EXPECT_EQ(round_trip(test::status_with(campaigns)).campaigns().size(),
            static_cast<int>(campaigns_per_reply_max));
}

TEST(StatusReply, HasRoomForAllThatItMayName) {
  const std::string name(128, 'x');
  const std::string text(reply_text_size_max, 'x');
  proto::CampaignStatus campaign = some_status();
  campaign.set_name(name);
  campaign.set_owner(name);
  campaign.set_storage_failure(text);
  proto::StatusReply full =
      test::status_with(std::vector<proto::CampaignStatus>(campaigns_per_reply_max, campaign));
  for (std::size_t i = 0; i < unserved_files_per_reply_max; ++i) {
    proto::UnservedFile& file = *full.add_unserved_files();
    file.set_file(text);
    file.set_reason(text);
  }
  for (std::size_t i = 0; i < quarantined_hosts_per_reply_max; ++i) {
    full.add_quarantined_hosts(name);
  }
  for (std::size_t i = 0; i < factories_max; ++i) {
    proto::FactoryStatus& factory = *full.add_factories();
    *factory.mutable_report() = test::factory_report(name, 30);
    factory.mutable_report()->set_batch_system(name);
    factory.mutable_report()->set_reason(text);
    factory.set_owner(name);
  }
  EXPECT_EQ(round_trip(full).SerializeAsString(), full.SerializeAsString());
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
  EXPECT_EQ(name_of(proto::CONTROL_ACTION_PAUSE), "pause");
  EXPECT_EQ(name_of(proto::CONTROL_ACTION_RESUME), "resume");
  EXPECT_EQ(name_of(proto::CONTROL_ACTION_CANCEL), "cancel");
  EXPECT_EQ(name_of(proto::CONTROL_ACTION_SET_PRIORITY), "set-priority");
  EXPECT_EQ(name_of(proto::CONTROL_ACTION_RETRY), "retry");
  EXPECT_EQ(name_of(CampaignPhase::active), "active");
  EXPECT_EQ(name_of(CampaignPhase::paused), "paused");
  EXPECT_EQ(name_of(CampaignPhase::finished), "finished");
  EXPECT_EQ(name_of(CampaignPhase::cancelled), "cancelled");
  EXPECT_EQ(name_of(proto::FACTORY_PHASE_ACTIVE), "active");
  EXPECT_EQ(name_of(proto::FACTORY_PHASE_WAITING), "waiting");
  EXPECT_EQ(name_of(proto::FACTORY_PHASE_PAUSED), "paused");
}

}  // namespace
}  // namespace proofmass::wire
