// What a client or a coordinator may not send: each rule of the client decoders, broken by one
// change of a good message.

#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <string>
#include <variant>

#include "proto/wire/client_codec.hpp"
#include "tests/proto/wire/requests.hpp"

namespace proofmass::wire {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

DecodeError refusal_of_request(const std::string& bytes) {
  const auto decoded = decode_request(bytes);
  const auto* const error = std::get_if<DecodeError>(&decoded);
  return error != nullptr ? *error : DecodeError{DecodeFault::invalid, "accepted"};
}

DecodeError refusal_of_reply(const std::string& bytes) {
  const auto decoded = decode_reply(bytes);
  const auto* const error = std::get_if<DecodeError>(&decoded);
  return error != nullptr ? *error : DecodeError{DecodeFault::invalid, "accepted"};
}

/// Why the request is refused after the change.
std::string refusal(const proto::RequestEnvelope& good,
                    const std::function<void(proto::RequestEnvelope&)>& change) {
  proto::RequestEnvelope envelope;
  EXPECT_TRUE(envelope.ParseFromString(encode(test::numbered(1, good))));
  EXPECT_EQ(refusal_of_request(envelope.SerializeAsString()).text, "accepted");
  change(envelope);
  const DecodeError error = refusal_of_request(envelope.SerializeAsString());
  EXPECT_EQ(error.fault, DecodeFault::invalid);
  return error.text;
}

std::string refusal(const proto::ReplyEnvelope& good,
                    const std::function<void(proto::ReplyEnvelope&)>& change) {
  proto::ReplyEnvelope envelope;
  EXPECT_TRUE(envelope.ParseFromString(encode(test::numbered(1, good))));
  EXPECT_EQ(refusal_of_reply(envelope.SerializeAsString()).text, "accepted");
  change(envelope);
  const DecodeError error = refusal_of_reply(envelope.SerializeAsString());
  EXPECT_EQ(error.fault, DecodeFault::invalid);
  return error.text;
}

std::string refusal_of_submit(const std::function<void(proto::SubmitRequest&)>& change) {
  return refusal(test::submission({.text = "a"}),
                 [&](auto& envelope) { change(*envelope.mutable_submit()); });
}

std::string refusal_of_control(const std::function<void(proto::ControlRequest&)>& change) {
  return refusal(test::control(proto::CONTROL_ACTION_PAUSE, "a"),
                 [&](auto& envelope) { change(*envelope.mutable_control()); });
}

std::string refusal_of_status(const std::function<void(proto::StatusReply&)>& change) {
  proto::CampaignStatus campaign = test::campaign_status("a", 0, 10);
  campaign.set_remaining_s(1.0);
  return refusal(test::reply_with(test::status_with({campaign})),
                 [&](auto& envelope) { change(*envelope.mutable_status()); });
}

std::string refusal_of_campaign(const std::function<void(proto::CampaignStatus&)>& change) {
  return refusal_of_status([&](auto& status) { change(*status.mutable_campaigns(0)); });
}

std::string refusal_of_worker(const std::function<void(proto::WorkerStatus&)>& change) {
  return refusal(test::reply_with({test::worker_status(1, "w", "h")}),
                 [&](auto& envelope) { change(*envelope.mutable_workers()->mutable_workers(0)); });
}

proto::RequestEnvelope status_request() {
  proto::RequestEnvelope envelope;
  envelope.set_protocol_version(protocol_version);
  envelope.set_request_id(1);
  envelope.mutable_status();
  return envelope;
}

// Envelopes.

TEST(MalformedRequest, OfTooManyBytesIsRefusedUnread) {
  const DecodeError error = refusal_of_request(std::string(submit_size_max + 1, 'x'));
  EXPECT_EQ(error.fault, DecodeFault::too_large);
  EXPECT_EQ(error.text, "request size = 67108865 bytes (must be at most 67108864)");
}

TEST(MalformedRequest, MayBeLargeForACampaignOnly) {
  proto::RequestEnvelope envelope = status_request();
  envelope.mutable_control()->set_campaign(std::string(request_size_max, 'x'));
  const DecodeError error = refusal_of_request(envelope.SerializeAsString());
  EXPECT_EQ(error.fault, DecodeFault::too_large);
  EXPECT_EQ(error.text, "request size = 65548 bytes (must be at most 65536)");
}

std::string refusal_of_part(const std::function<void(proto::RequestPart&)>& change) {
  return refusal(test::request_of(test::part(10, 4, "abc")),
                 [&](auto& envelope) { change(*envelope.mutable_part()); });
}

std::string refusal_of_question(const std::function<void(proto::AnswerRequest&)>& change) {
  return refusal(test::question(proto::QUESTION_QUERY, {}, "x"),
                 [&](auto& envelope) { change(*envelope.mutable_answer()); });
}

TEST(MalformedQuestion, HasLimits) {
  EXPECT_EQ(refusal_of_question([](auto& question) { question.set_campaign("../a"); }),
            "campaign = 4 bytes (must be 1 to 128 of [A-Za-z0-9._-], a letter or digit first)");
  EXPECT_EQ(refusal_of_question(
                [](auto& question) { question.set_question(static_cast<proto::Question>(5)); }),
            "question = 5 (must be in [1, 4])");
  EXPECT_EQ(refusal_of_question([](auto& question) { question.clear_statement(); }),
            "statement size = 0 (must be in [1, 32768])");
  EXPECT_EQ(refusal_of_question([](auto& question) {
              question.set_statement(std::string(statement_size_max + 1, 'x'));
            }),
            "statement size = 32769 (must be in [1, 32768])");
  EXPECT_EQ(
      refusal_of_question([](auto& question) { question.set_statement(std::string("a\0b", 3)); }),
      "statement size = 3 bytes (must not have a zero byte)");
  EXPECT_EQ(refusal_of_question([](auto& question) { question.add_options(""); }),
            "option size = 0 (must be in [1, 4096])");
  EXPECT_EQ(refusal_of_question([](auto& question) {
              for (int i = 0; i < 65; ++i) question.add_options("--json");
            }),
            "options = 65 entries (must be in [0, 64])");
  EXPECT_EQ(refusal_of_question([](auto& question) {
              question.set_known_size(1);
              question.set_known_sha256(std::string(64, 'g'));
            }),
            "known_sha256 = 64 bytes (must be 64 hexadecimal digits)");
}

TEST(MalformedPart, MustLieWithinItsRequest) {
  EXPECT_EQ(refusal_of_part([](auto& part) { part.set_total_size(0); }),
            "total_size = 0 (must be in [1, 67108864])");
  EXPECT_EQ(refusal_of_part([](auto& part) { part.set_total_size(submit_size_max + 1); }),
            "total_size = 67108865 (must be in [1, 67108864])");
  EXPECT_EQ(refusal_of_part([](auto& part) { part.set_offset(10); }),
            "offset = 10 (must be in [0, 9])");
  EXPECT_EQ(refusal_of_part([](auto& part) { part.set_offset(~std::uint64_t{0}); }),
            "offset = 18446744073709551615 (must be in [0, 9])");
  EXPECT_EQ(refusal_of_part([](auto& part) { part.set_offset(8); }),
            "slice size = 3 (must be in [1, 2])");
  EXPECT_EQ(refusal_of_part([](auto& part) { part.clear_slice(); }),
            "slice size = 0 (must be in [1, 262144])");
}

TEST(MalformedPart, MustNotBeLargerThanAMessage) {
  proto::RequestEnvelope envelope = status_request();
  envelope.mutable_part()->set_slice(std::string(request_message_size_max, 'x'));
  const DecodeError error = refusal_of_request(envelope.SerializeAsString());
  EXPECT_EQ(error.fault, DecodeFault::too_large);
}

TEST(MalformedRelease, MustNameAHost) {
  EXPECT_EQ(refusal(test::release("n7"),
                    [](auto& envelope) { envelope.mutable_release_host()->set_host("a b"); }),
            "host = 3 bytes (must be 1 to 128 of [A-Za-z0-9._-], a letter or digit first)");
}

std::string refusal_of_report(const std::function<void(proto::FactoryReport&)>& change) {
  return refusal(test::request_of(test::factory_report("fleet", 30)),
                 [&](auto& envelope) { change(*envelope.mutable_factory_report()); });
}

TEST(MalformedFactoryReport, HasNamesAPhaseTimesAndAText) {
  EXPECT_EQ(refusal_of_report([](auto& report) { report.set_name("a b"); }),
            "name = 3 bytes (must be 1 to 128 of [A-Za-z0-9._-], a letter or digit first)");
  EXPECT_EQ(refusal_of_report([](auto& report) { report.clear_batch_system(); }),
            "batch_system = 0 bytes (must be 1 to 128 of [A-Za-z0-9._-], a letter or digit first)");
  EXPECT_EQ(refusal_of_report([](auto& report) { report.clear_phase(); }),
            "phase = 0 (must be in [1, 3])");
  EXPECT_EQ(refusal_of_report(
                [](auto& report) { report.set_phase(static_cast<proto::FactoryPhase>(4)); }),
            "phase = 4 (must be in [1, 3])");
  EXPECT_EQ(refusal_of_report([](auto& report) { report.set_wait_s(nan); }),
            "wait_s = nan (must be >= 0)");
  EXPECT_EQ(refusal_of_report([](auto& report) { report.clear_interval_s(); }),
            "interval_s = 0 (must be in [1, 3600])");
  EXPECT_EQ(refusal_of_report([](auto& report) { report.set_interval_s(3601); }),
            "interval_s = 3601 (must be in [1, 3600])");
  EXPECT_EQ(refusal_of_report([](auto& report) { report.set_reason(std::string(4097, 'x')); }),
            "reason = 4097 bytes (must be at most 4096)");
  EXPECT_EQ(refusal_of_report([](auto& report) { report.set_reason("\x1b[2J"); }),
            "reason = 4 bytes (must be printable ASCII and line ends)");
}

std::string refusal_of_factory(const std::function<void(proto::FactoryStatus&)>& change) {
  proto::StatusReply good = test::status_with({});
  *good.add_factories()->mutable_report() = test::factory_report("fleet", 30);
  return refusal(test::reply_with(good),
                 [&](auto& envelope) { change(*envelope.mutable_status()->mutable_factories(0)); });
}

TEST(MalformedFactoryStatus, HasAReportAnOwnerAndATime) {
  EXPECT_EQ(refusal_of_factory([](auto& factory) { factory.clear_report(); }),
            "interval_s = 0 (must be in [1, 3600])");
  EXPECT_EQ(refusal_of_factory([](auto& factory) { factory.set_owner("a b"); }),
            "owner = 3 bytes (must be 1 to 128 of [A-Za-z0-9._-], a letter or digit first)");
  EXPECT_EQ(refusal_of_factory([](auto& factory) { factory.set_silent_s(-1.0); }),
            "silent_s = -1 (must be >= 0)");
}

TEST(MalformedStatus, NamesABoundedNumberOfFactories) {
  EXPECT_EQ(refusal_of_status([](auto& status) {
              for (std::size_t i = 0; i <= factories_max; ++i) status.add_factories();
            }),
            "factories = 65 entries (must be in [0, 64])");
}

TEST(MalformedStatus, MustNameFilesAndHostsInPrintableCharacters) {
  EXPECT_EQ(refusal_of_status([](auto& status) {
              auto& file = *status.add_unserved_files();
              file.set_file("a\x1b");
            }),
            "file = 2 bytes (must be printable ASCII and line ends)");
  EXPECT_EQ(
      refusal_of_status([](auto& status) { status.add_quarantined_hosts("a b"); }),
      "quarantined_hosts = 3 bytes (must be 1 to 128 of [A-Za-z0-9._-], a letter or digit first)");
  EXPECT_EQ(refusal_of_status([](auto& status) {
              for (std::size_t i = 0; i <= unserved_files_per_reply_max; ++i) {
                status.add_unserved_files();
              }
            }),
            "unserved_files = 65 entries (must be in [0, 64])");
}

TEST(MalformedRequest, ThatIsNoneIsUnparsable) {
  const DecodeError error = refusal_of_request("GET / HTTP/1.1");
  EXPECT_EQ(error.fault, DecodeFault::unparsable);
  EXPECT_EQ(error.text, "request = 14 bytes (must be an envelope of at most 65536 fields)");
}

TEST(MalformedRequest, OfAnotherVersionIsRefused) {
  proto::RequestEnvelope envelope = status_request();
  envelope.set_protocol_version(protocol_version + 1);
  const DecodeError error = refusal_of_request(envelope.SerializeAsString());
  EXPECT_EQ(error.fault, DecodeFault::wrong_version);
  EXPECT_EQ(error.text, "protocol_version = 9 (must be 8)");
}

TEST(MalformedRequest, WithoutContentIsRefused) {
  proto::RequestEnvelope envelope = status_request();
  envelope.clear_request();
  const DecodeError error = refusal_of_request(envelope.SerializeAsString());
  EXPECT_EQ(error.fault, DecodeFault::empty);
  EXPECT_EQ(error.text, "request = none (must be of a known kind)");
}

TEST(MalformedRequest, HasANumber) {
  EXPECT_EQ(refusal(status_request(), [](auto& envelope) { envelope.clear_request_id(); }),
            "request_id = 0 (must not be 0)");
}

TEST(MalformedRequest, OfAWorkerIsRefused) {
  proto::Envelope worker;
  worker.set_protocol_version(protocol_version);
  worker.set_session(1);
  worker.set_sequence(1);
  worker.mutable_bye()->set_reason(proto::LOSS_REASON_DRAINED);
  EXPECT_NE(refusal_of_request(worker.SerializeAsString()).text, "accepted");
}

TEST(MalformedReply, OfTooManyBytesIsRefusedUnread) {
  const DecodeError error = refusal_of_reply(std::string(reply_size_max + 1, 'x'));
  EXPECT_EQ(error.fault, DecodeFault::too_large);
  EXPECT_EQ(error.text, "reply size = 4194305 bytes (must be at most 4194304)");
}

TEST(MalformedReply, OfAnotherVersionOrWithoutContentIsRefused) {
  proto::ReplyEnvelope envelope;
  envelope.set_protocol_version(1);
  EXPECT_EQ(refusal_of_reply(envelope.SerializeAsString()).fault, DecodeFault::wrong_version);
  envelope.set_protocol_version(protocol_version);
  const DecodeError error = refusal_of_reply(envelope.SerializeAsString());
  EXPECT_EQ(error.fault, DecodeFault::empty);
  EXPECT_EQ(error.text, "reply = none (must be of a known kind)");
}

// Two bytes may stand for a message that takes more than a hundred bytes of memory.
TEST(MalformedRequest, OfManyEmptyTablesIsRefusedBeforeItIsParsed) {
  proto::RequestEnvelope envelope = status_request();
  for (int i = 0; i < 65536; ++i) envelope.mutable_submit()->mutable_definition()->add_tables();
  const DecodeError error = refusal_of_request(envelope.SerializeAsString());
  EXPECT_EQ(error.fault, DecodeFault::unparsable);
}

TEST(MalformedRequest, OfManyUnknownFieldsIsRefusedBeforeItIsParsed) {
  std::string bytes = status_request().SerializeAsString();
  for (int i = 0; i < 65534; ++i) bytes += "\x78\x01";  // Field 15, a number.
  EXPECT_EQ(refusal_of_request(bytes).fault, DecodeFault::unparsable);
}

TEST(MalformedRequest, MayNotHideFieldsInAGroup) {
  const std::string group = "\x7b\x08\x01\x7c";  // Field 15 begins, field 1 in it, field 15 ends.
  proto::RequestEnvelope envelope;
  ASSERT_TRUE(envelope.ParseFromString(status_request().SerializeAsString() + group));
  EXPECT_EQ(refusal_of_request(status_request().SerializeAsString() + group).fault,
            DecodeFault::unparsable);
}

// Requests.

TEST(MalformedSubmitRequest, HasAPriorityAndAFraction) {
  for (const int priority : {-101, 101, std::numeric_limits<int>::min()}) {
    EXPECT_EQ(refusal_of_submit([&](auto& submit) { submit.set_priority(priority); }),
              "priority = " + std::to_string(priority) + " (must be in [-100, 100])");
  }
  for (const auto& [value, text] : {std::pair{-0.1, "-0.1"}, {1.1, "1.1"}, {nan, "nan"}}) {
    EXPECT_EQ(refusal_of_submit([&](auto& submit) { submit.set_audit_fraction(value); }),
              std::string("audit = ") + text + " (must be in [0, 1])");
  }
}

TEST(MalformedSubmitRequest, HasAStopRuleAndABudget) {
  EXPECT_EQ(refusal_of_submit([](auto& submit) { submit.set_stop_rule(std::string(201, ' ')); }),
            "until = 201 bytes (must be at most 200)");
  EXPECT_EQ(refusal_of_submit([](auto& submit) { submit.set_failures_max(1'000'000'001); }),
            "failures = 1000000001 (must be in [0, 1000000000])");
}

// The other rules of definitions are tested with those that workers get: one function checks both.
TEST(MalformedSubmitRequest, HasADefinition) {
  EXPECT_EQ(refusal_of_submit([](auto& submit) { submit.clear_definition(); }),
            "definition.text size = 0 (must be in [1, 1048576])");
  EXPECT_EQ(refusal_of_submit([](auto& submit) {
              submit.mutable_definition()->add_table_columns()->add_values(nan);
            }),
            "definition.table_columns.values = nan (must be finite)");
  EXPECT_EQ(refusal_of_submit(
                [](auto& submit) { submit.mutable_definition()->set_model_version("a b"); }),
            "definition.model_version = 3 bytes (must be 1 to 128 of [A-Za-z0-9._-], a letter or "
            "digit first)");
  EXPECT_EQ(refusal_of_submit([](auto& submit) {
              submit.set_model_description(std::string(definition_text_size_max + 1, 'x'));
            }),
            "model_description size = 1048577 (must be in [0, 1048576])");
}

TEST(MalformedControlRequest, HasAnActionAndACampaign) {
  EXPECT_EQ(refusal_of_control([](auto& control) { control.clear_action(); }),
            "action = 0 (must be in [1, 6])");
  EXPECT_EQ(refusal_of_control(
                [](auto& control) { control.set_action(static_cast<proto::ControlAction>(7)); }),
            "action = 7 (must be in [1, 6])");
  EXPECT_EQ(refusal_of_control([](auto& control) { control.set_priority(101); }),
            "priority = 101 (must be in [-100, 100])");
  EXPECT_EQ(refusal_of_control([](auto& control) { control.set_campaign("a b"); }),
            "campaign = 3 bytes (must be 1 to 128 of [A-Za-z0-9._-], a letter or digit first)");
}

// Replies.

TEST(MalformedStatusReply, HasVersionsAndATime) {
  EXPECT_EQ(refusal_of_status([](auto& status) { status.set_version(""); }),
            "version = 0 bytes (must be 1 to 128 of [A-Za-z0-9._-], a letter or digit first)");
  EXPECT_EQ(
      refusal_of_status([](auto& status) { status.set_model_version("\n"); }),
      "model_version = 1 bytes (must be 1 to 128 of [A-Za-z0-9._-], a letter or digit first)");
  EXPECT_EQ(refusal_of_status([](auto& status) { status.set_uptime_s(-1.0); }),
            "uptime_s = -1 (must be >= 0)");
}

TEST(MalformedStatusReply, NamesABoundedNumberOfCampaigns) {
  EXPECT_EQ(refusal_of_status([](auto& status) {
              for (int i = 0; i < 512; ++i) status.add_campaigns();
            }),
            "campaigns = 513 entries (must be in [0, 512])");
}

TEST(MalformedCampaignStatus, HasANameAPhaseAndAPriority) {
  EXPECT_EQ(refusal_of_campaign([](auto& campaign) { campaign.set_name(""); }),
            "name = 0 bytes (must be 1 to 128 of [A-Za-z0-9._-], a letter or digit first)");
  EXPECT_EQ(refusal_of_campaign([](auto& campaign) { campaign.clear_phase(); }),
            "phase = 0 (must be in [1, 4])");
  EXPECT_EQ(refusal_of_campaign([](auto& campaign) { campaign.set_priority(101); }),
            "priority = 101 (must be in [-100, 100])");
}

TEST(MalformedCampaignStatus, CountsNoMoreRunsThanThereAre) {
  EXPECT_EQ(refusal_of_campaign([](auto& campaign) { campaign.set_num_runs(0); }),
            "num_runs = 0 (must be in [1, 1000000000])");
  EXPECT_EQ(refusal_of_campaign([](auto& campaign) { campaign.set_num_given_up(11); }),
            "num_given_up = 11 (must be in [0, 10])");
  EXPECT_EQ(refusal_of_campaign([](auto& campaign) {
              campaign.set_num_given_up(3);
              campaign.set_num_done(8);
            }),
            "num_done = 8 (must be in [0, 7])");
}

TEST(MalformedCampaignStatus, HasFiniteNumbers) {
  EXPECT_EQ(refusal_of_campaign([](auto& campaign) { campaign.set_rate_hz(nan); }),
            "rate_hz = nan (must be >= 0)");
  EXPECT_EQ(refusal_of_campaign([](auto& campaign) { campaign.set_remaining_s(-1.0); }),
            "remaining_s = -1 (must be >= 0)");
}

TEST(MalformedTexts, AreBoundedAndHarmlessToATerminal) {
  EXPECT_EQ(refusal_of_campaign(
                [](auto& campaign) { campaign.set_storage_failure(std::string(4097, 'x')); }),
            "storage_failure = 4097 bytes (must be at most 4096)");
  EXPECT_EQ(refusal_of_status([](auto& status) { status.set_last_refusal("\r"); }),
            "last_refusal = 1 bytes (must be printable ASCII and line ends)");
  EXPECT_EQ(refusal_of_campaign([](auto& campaign) { campaign.set_missing_model("\x1b[2J"); }),
            "missing_model = 4 bytes (must be 1 to 128 of [A-Za-z0-9._-], a letter or digit "
            "first)");
  EXPECT_EQ(refusal_of_campaign([](auto& campaign) { campaign.set_model_version("\x1b[2J"); }),
            "model_version = 4 bytes (must be 1 to 128 of [A-Za-z0-9._-], a letter or digit "
            "first)");
  EXPECT_EQ(refusal(done_reply("a"),
                    [](auto& envelope) { envelope.mutable_done()->set_text("\x1b[2J"); }),
            "text = 4 bytes (must be printable ASCII and line ends)");
  EXPECT_EQ(
      refusal(error_reply("a"), [](auto& envelope) { envelope.mutable_error()->set_text("\r"); }),
      "text = 1 bytes (must be printable ASCII and line ends)");
}

TEST(MalformedWorkersReply, NamesABoundedNumberOfWorkers) {
  EXPECT_EQ(refusal(test::reply_with(std::vector<proto::WorkerStatus>{}),
                    [](auto& envelope) {
                      for (int i = 0; i < 4097; ++i) envelope.mutable_workers()->add_workers();
                    }),
            "workers = 4097 entries (must be in [0, 4096])");
}

TEST(MalformedWorkerStatus, HasANumberNamesAndATime) {
  EXPECT_EQ(refusal_of_worker([](auto& worker) { worker.clear_worker_id(); }),
            "worker_id = 0 (must not be 0)");
  EXPECT_EQ(refusal_of_worker([](auto& worker) { worker.set_name(""); }),
            "name = 0 bytes (must be 1 to 128 of [A-Za-z0-9._-], a letter or digit first)");
  EXPECT_EQ(refusal_of_worker([](auto& worker) { worker.set_host("a\n"); }),
            "host = 2 bytes (must be 1 to 128 of [A-Za-z0-9._-], a letter or digit first)");
  EXPECT_EQ(refusal_of_worker([](auto& worker) { worker.set_silent_s(nan); }),
            "silent_s = nan (must be >= 0)");
  EXPECT_EQ(refusal_of_worker([](auto& worker) { worker.set_cards("a\n"); }),
            "cards = a? (must be printable ASCII)");
  EXPECT_EQ(refusal_of_worker([](auto& worker) { worker.set_card_rate_hz(-1.0); }),
            "card_rate_hz = -1 (must be >= 0)");
}

}  // namespace
}  // namespace proofmass::wire
