// What a client or a coordinator may not send: each rule of the client decoders, broken by one
// change of a good message.

#include "tests/proto/wire/refusal.hpp"

namespace proofmass::wire {
namespace {

using test::BadChange;
using test::message_of;
using test::name_rule;
using test::refusal_of;
using test::string_of;
using test::times;

void expect_refused_requests(const std::string& good, std::string_view path,
                             const std::vector<BadChange>& changes) {
  test::expect_refusals<proto::RequestEnvelope>(good, path, changes);
}

void expect_refused_replies(const std::string& good, std::string_view path,
                            const std::vector<BadChange>& changes) {
  test::expect_refusals<proto::ReplyEnvelope>(good, path, changes);
}

const std::string text_rule = " bytes (must be printable ASCII and line ends)";
const std::string good_submit = "submit { definition { text: 'a' } }";
const std::string good_factory =
    "name: 'fleet' batch_system: 'pbs' phase: FACTORY_PHASE_ACTIVE interval_s: 30";
const std::string good_status =
    "status { version: 'v' model_version: 'm' uptime_s: 1 campaigns { name: 'a' num_runs: 10"
    " phase: CAMPAIGN_PHASE_ACTIVE remaining_s: 1 } factories { report { " +
    good_factory + " } } }";
const std::string good_workers = "workers { workers { worker_id: 1 name: 'w' host: 'h' } }";

// Envelopes.

TEST(MalformedRequest, OfTooManyBytesIsRefusedUnread) {
  const DecodeError error =
      refusal_of<proto::RequestEnvelope>(std::string(submit_size_max + 1, 'x'));
  EXPECT_EQ(error.fault, DecodeFault::too_large);
  EXPECT_EQ(error.text, "request size = 67108865 bytes (must be at most 67108864)");
}

TEST(MalformedRequest, MayBeLargeForACampaignOnly) {
  const DecodeError error = refusal_of(
      message_of<proto::RequestEnvelope>("control { campaign: " + string_of(65536) + "}"));
  EXPECT_EQ(error.fault, DecodeFault::too_large);
  EXPECT_EQ(error.text, "request size = 65548 bytes (must be at most 65536)");
}

TEST(MalformedRequest, ThatIsNoneIsUnparsable) {
  const DecodeError error = refusal_of<proto::RequestEnvelope>("GET / HTTP/1.1");
  EXPECT_EQ(error.fault, DecodeFault::unparsable);
  EXPECT_EQ(error.text, "request = 14 bytes (must be an envelope of at most 65536 fields)");
}

TEST(MalformedRequest, OfAnotherVersionIsRefused) {
  auto envelope = message_of<proto::RequestEnvelope>("status {}");
  envelope.set_protocol_version(protocol_version + 1);
  const DecodeError error = refusal_of(envelope);
  EXPECT_EQ(error.fault, DecodeFault::wrong_version);
  EXPECT_EQ(error.text, "protocol_version = 9 (must be 8)");
}

TEST(MalformedRequest, WithoutContentIsRefused) {
  const DecodeError error = refusal_of(message_of<proto::RequestEnvelope>(""));
  EXPECT_EQ(error.fault, DecodeFault::empty);
  EXPECT_EQ(error.text, "request = none (must be of a known kind)");
}

TEST(MalformedRequest, HasANumber) {
  expect_refused_requests("status {}", "", {{"request_id: 0", "request_id = 0 (must not be 0)"}});
}

TEST(MalformedRequest, OfAWorkerIsRefused) {
  const auto worker =
      message_of<proto::Envelope>("bye { reason: LOSS_REASON_DRAINED } sequence: 1");
  EXPECT_NE(refusal_of<proto::RequestEnvelope>(worker.SerializeAsString()).text, "accepted");
}

// Two bytes may stand for a message that takes more than a hundred bytes of memory.
TEST(MalformedRequest, OfManyEmptyTablesIsRefusedBeforeItIsParsed) {
  auto envelope = message_of<proto::RequestEnvelope>("submit { definition {} }");
  for (int i = 0; i < 65536; ++i) envelope.mutable_submit()->mutable_definition()->add_tables();
  EXPECT_EQ(refusal_of(envelope).fault, DecodeFault::unparsable);
}

TEST(MalformedRequest, OfManyUnknownFieldsIsRefusedBeforeItIsParsed) {
  const auto good = message_of<proto::RequestEnvelope>("status {}").SerializeAsString();
  const std::string fields = times(65534, "\x78\x01");  // Field 15, a number.
  EXPECT_EQ(refusal_of<proto::RequestEnvelope>(good + fields).fault, DecodeFault::unparsable);
}

TEST(MalformedRequest, MayNotHideFieldsInAGroup) {
  const std::string group = "\x7b\x08\x01\x7c";  // Field 15 begins, field 1 in it, field 15 ends.
  const auto good = message_of<proto::RequestEnvelope>("status {}").SerializeAsString();
  proto::RequestEnvelope envelope;
  ASSERT_TRUE(envelope.ParseFromString(good + group));
  EXPECT_EQ(refusal_of<proto::RequestEnvelope>(good + group).fault, DecodeFault::unparsable);
}

TEST(MalformedReply, OfTooManyBytesIsRefusedUnread) {
  const DecodeError error = refusal_of<proto::ReplyEnvelope>(std::string(reply_size_max + 1, 'x'));
  EXPECT_EQ(error.fault, DecodeFault::too_large);
  EXPECT_EQ(error.text, "reply size = 4194305 bytes (must be at most 4194304)");
}

TEST(MalformedReply, OfAnotherVersionOrWithoutContentIsRefused) {
  auto envelope = message_of<proto::ReplyEnvelope>("");
  const DecodeError error = refusal_of(envelope);
  EXPECT_EQ(error.fault, DecodeFault::empty);
  EXPECT_EQ(error.text, "reply = none (must be of a known kind)");
  envelope.set_protocol_version(1);
  EXPECT_EQ(refusal_of(envelope).fault, DecodeFault::wrong_version);
}

// Requests.

TEST(MalformedQuestion, HasLimits) {
  expect_refused_requests(
      "answer { campaign: 'a' question: QUESTION_QUERY statement: 'x' }", "answer",
      {{"campaign: '../a'", "campaign = 4" + name_rule},
       {"question: 5", "question = 5 (must be in [1, 4])"},
       {"statement: ''", "statement size = 0 (must be in [1, 32768])"},
       {"statement: " + string_of(32769), "statement size = 32769 (must be in [1, 32768])"},
       {"statement: 'a\\0b'", "statement size = 3 bytes (must not have a zero byte)"},
       {"options: ''", "option size = 0 (must be in [1, 4096])"},
       {times(65, "options: '--json' "), "options = 65 entries (must be in [0, 64])"},
       {"known_size: 1 known_sha256: '" + times(64, "g") + "'",
        "known_sha256 = 64 bytes (must be 64 hexadecimal digits)"}});
}

TEST(MalformedPart, MustLieWithinItsRequest) {
  expect_refused_requests(
      "part { total_size: 10 offset: 4 slice: 'abc' }", "part",
      {{"total_size: 0", "total_size = 0 (must be in [1, 67108864])"},
       {"total_size: 67108865", "total_size = 67108865 (must be in [1, 67108864])"},
       {"offset: 10", "offset = 10 (must be in [0, 9])"},
       {"offset: 18446744073709551615", "offset = 18446744073709551615 (must be in [0, 9])"},
       {"offset: 8", "slice size = 3 (must be in [1, 2])"},
       {"slice: ''", "slice size = 0 (must be in [1, 262144])"}});
}

TEST(MalformedPart, MustNotBeLargerThanAMessage) {
  auto envelope = message_of<proto::RequestEnvelope>("part {}");
  envelope.mutable_part()->set_slice(std::string(request_message_size_max, 'x'));
  EXPECT_EQ(refusal_of(envelope).fault, DecodeFault::too_large);
}

TEST(MalformedRelease, MustNameAHost) {
  expect_refused_requests("release_host { host: 'n7' }", "release_host",
                          {{"host: 'a b'", "host = 3" + name_rule}});
}

TEST(MalformedFactoryReport, HasNamesAPhaseTimesAndAText) {
  expect_refused_requests(
      "factory_report { " + good_factory + " }", "factory_report",
      {{"name: 'a b'", "name = 3" + name_rule},
       {"batch_system: ''", "batch_system = 0" + name_rule},
       {"phase: FACTORY_PHASE_UNSPECIFIED", "phase = 0 (must be in [1, 3])"},
       {"phase: 4", "phase = 4 (must be in [1, 3])"},
       {"wait_s: nan", "wait_s = nan (must be >= 0)"},
       {"interval_s: 0", "interval_s = 0 (must be in [1, 3600])"},
       {"interval_s: 3601", "interval_s = 3601 (must be in [1, 3600])"},
       {"reason: " + string_of(4097), "reason = 4097 bytes (must be at most 4096)"},
       {"reason: '\\x1b[2J'", "reason = 4" + text_rule}});
}

TEST(MalformedSubmitRequest, HasWishesWithinLimits) {
  const std::string priority_rule = " (must be in [-100, 100])";
  expect_refused_requests(
      good_submit, "submit",
      {{"priority: -101", "priority = -101" + priority_rule},
       {"priority: 101", "priority = 101" + priority_rule},
       {"priority: -2147483648", "priority = -2147483648" + priority_rule},
       {"audit_fraction: -0.1", "audit = -0.1 (must be in [0, 1])"},
       {"audit_fraction: 1.1", "audit = 1.1 (must be in [0, 1])"},
       {"audit_fraction: nan", "audit = nan (must be in [0, 1])"},
       {"stop_rule: " + string_of(201), "until = 201 bytes (must be at most 200)"},
       {"failures_max: 1000000001", "failures = 1000000001 (must be in [0, 1000000000])"}});
}

// The other rules of definitions are tested with those that workers get: one function checks both.
TEST(MalformedSubmitRequest, HasADefinition) {
  expect_refused_requests(
      good_submit, "submit",
      {{"definition { text: '' }", "definition.text size = 0 (must be in [1, 1048576])"},
       {"definition { table_columns { values: nan } }",
        "definition.table_columns.values = nan (must be finite)"},
       {"definition { model_version: 'a b' }", "definition.model_version = 3" + name_rule},
       {"model_description: " + string_of(1048577),
        "model_description size = 1048577 (must be in [0, 1048576])"}});
}

TEST(MalformedControlRequest, HasAnActionAndACampaign) {
  expect_refused_requests("control { action: CONTROL_ACTION_PAUSE campaign: 'a' }", "control",
                          {{"action: CONTROL_ACTION_UNSPECIFIED", "action = 0 (must be in [1, 6])"},
                           {"action: 7", "action = 7 (must be in [1, 6])"},
                           {"priority: 101", "priority = 101 (must be in [-100, 100])"},
                           {"campaign: 'a b'", "campaign = 3" + name_rule}});
}

// Replies.

TEST(MalformedStatusReply, HasVersionsAndATime) {
  expect_refused_replies(good_status, "status",
                         {{"version: ''", "version = 0" + name_rule},
                          {"model_version: '\\n'", "model_version = 1" + name_rule},
                          {"uptime_s: -1", "uptime_s = -1 (must be >= 0)"}});
}

TEST(MalformedStatusReply, NamesABoundedNumberOfEachThing) {
  expect_refused_replies(
      good_status, "status",
      {{times(512, "campaigns {} "), "campaigns = 513 entries (must be in [0, 512])"},
       {times(64, "factories {} "), "factories = 65 entries (must be in [0, 64])"},
       {times(65, "unserved_files {} "), "unserved_files = 65 entries (must be in [0, 64])"}});
}

TEST(MalformedStatusReply, NamesFilesAndHostsInPrintableCharacters) {
  expect_refused_replies(good_status, "status",
                         {{"unserved_files { file: 'a\\x1b' }", "file = 2" + text_rule},
                          {"quarantined_hosts: 'a b'", "quarantined_hosts = 3" + name_rule},
                          {"last_refusal: '\\r'", "last_refusal = 1" + text_rule}});
}

TEST(MalformedFactoryStatus, HasAReportAnOwnerAndATime) {
  expect_refused_replies(good_status, "status.factories",
                         {{"-report", "interval_s = 0 (must be in [1, 3600])"},
                          {"owner: 'a b'", "owner = 3" + name_rule},
                          {"silent_s: -1", "silent_s = -1 (must be >= 0)"}});
}

TEST(MalformedCampaignStatus, HasANameAPhaseAndAPriority) {
  expect_refused_replies(good_status, "status.campaigns",
                         {{"name: ''", "name = 0" + name_rule},
                          {"phase: CAMPAIGN_PHASE_UNSPECIFIED", "phase = 0 (must be in [1, 4])"},
                          {"priority: 101", "priority = 101 (must be in [-100, 100])"}});
}

TEST(MalformedCampaignStatus, CountsNoMoreRunsThanThereAre) {
  expect_refused_replies(good_status, "status.campaigns",
                         {{"num_runs: 0", "num_runs = 0 (must be in [1, 1000000000])"},
                          {"num_given_up: 11", "num_given_up = 11 (must be in [0, 10])"},
                          {"num_given_up: 3 num_done: 8", "num_done = 8 (must be in [0, 7])"}});
}

TEST(MalformedCampaignStatus, HasFiniteNumbersAndTextsThatAreHarmlessToATerminal) {
  expect_refused_replies(good_status, "status.campaigns",
                         {{"rate_hz: nan", "rate_hz = nan (must be >= 0)"},
                          {"remaining_s: -1", "remaining_s = -1 (must be >= 0)"},
                          {"storage_failure: " + string_of(4097),
                           "storage_failure = 4097 bytes (must be at most 4096)"},
                          {"missing_model: '\\x1b[2J'", "missing_model = 4" + name_rule},
                          {"model_version: '\\x1b[2J'", "model_version = 4" + name_rule}});
}

TEST(MalformedTextReplies, AreHarmlessToATerminal) {
  expect_refused_replies("done { text: 'a' }", "done",
                         {{"text: '\\x1b[2J'", "text = 4" + text_rule}});
  expect_refused_replies("error { text: 'a' }", "error", {{"text: '\\r'", "text = 1" + text_rule}});
}

TEST(MalformedWorkersReply, NamesABoundedNumberOfWorkers) {
  expect_refused_replies(
      "workers {}", "workers",
      {{times(4097, "workers {} "), "workers = 4097 entries (must be in [0, 4096])"}});
}

TEST(MalformedWorkerStatus, HasANumberNamesAndATime) {
  expect_refused_replies(good_workers, "workers.workers",
                         {{"worker_id: 0", "worker_id = 0 (must not be 0)"},
                          {"name: ''", "name = 0" + name_rule},
                          {"host: 'a\\n'", "host = 2" + name_rule},
                          {"silent_s: nan", "silent_s = nan (must be >= 0)"},
                          {"cards: 'a\\n'", "cards = a? (must be printable ASCII)"},
                          {"card_rate_hz: -1", "card_rate_hz = -1 (must be >= 0)"}});
}

}  // namespace
}  // namespace proofmass::wire
