// What a peer may not send: each rule of the decoder, broken by one change of a good message.

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <fstream>
#include <iterator>
#include <regex>

#include "tests/proto/wire/refusal.hpp"

namespace proofmass::wire {
namespace {

using test::BadChange;
using test::name_rule;
using test::refusal_of;
using test::string_of;
using test::times;

const std::string good_hello =
    "hello { worker_name: 'w' host: 'h' process_id: 1 num_slots: 1 model_version: 'm' build: 'b'"
    " former { session: 1 reason: LOSS_REASON_CRASHED signal: 11 } }";
const std::string good_lease =
    "run_lease { campaign: 1 num_runs: 2 attempt: 1 table_values: [1, 2] }";
const std::string good_welcome = "welcome { worker_id: 1 heartbeat_interval_s: 1 }";
const std::string good_part =
    "definition_part { campaign: 1 offset: 2 total_size: 5 checksum: 1 content: 'abc' }";
const std::string good_runs = "campaign: 1 attempt: 1 ranges { count: 1 }";
const std::string good_give_back =
    "give_back { reason: LOSS_REASON_DRAINED runs { " + good_runs + " } }";
const std::string good_heartbeat =
    "heartbeat { num_runs_max: 1 held { " + good_runs +
    " } computing { campaign: 1 ranges { count: 1 } num_steps_done: 1 } }";
const std::string good_retract = "retract { campaign: 1 ranges { count: 1 } }";
const std::string good_not_served = "not_served { campaign: 1 ranges { count: 1 } }";
const std::string good_forget = "forget { campaign: 1 num_runs: 1 }";
const std::string good_request = "campaign_request { campaign: 1 }";
const std::string good_ack = "result_ack { campaign: 1 runs: 1 }";
const std::string ten_numbers = "[" + times(9, "1, ") + "1]";
const std::string good_batch =
    "result_batch { campaign: 1 attempt: 1 results { status: RUN_STATUS_COMPLETED truth: " +
    ten_numbers + " estimate: " + ten_numbers + " health: [1, 2, 3] } }";

void expect_refusals(const std::string& good, std::string_view path,
                     const std::vector<BadChange>& changes) {
  test::expect_refusals<proto::Envelope>(good, path, changes);
}

// Envelopes.

TEST(MalformedEnvelope, OfTooManyBytesIsNotParsed) {
  const DecodeError error = refusal_of<proto::Envelope>(std::string(message_size_max + 1, 'x'));
  EXPECT_EQ(error.fault, DecodeFault::too_large);
  EXPECT_EQ(error.text, "message size = 4194305 bytes (must be at most 4194304)");
}

TEST(MalformedEnvelope, ThatIsNoneIsUnparsable) {
  const DecodeError error = refusal_of<proto::Envelope>("GET / HTTP/1.1");
  EXPECT_EQ(error.fault, DecodeFault::unparsable);
  EXPECT_EQ(error.text, "message = 14 bytes (must be an envelope of at most 65536 fields)");
}

// Parsed, two bytes a field would take a hundred times their size.
TEST(MalformedEnvelope, OfTooManyFieldsIsNotParsed) {
  auto envelope = test::message_of<proto::Envelope>("heartbeat {}");
  for (int i = 0; i < 65536; ++i) envelope.mutable_heartbeat()->add_held();
  const DecodeError error = refusal_of(envelope);
  EXPECT_EQ(error.fault, DecodeFault::unparsable);
  EXPECT_EQ(error.text, "message = 131088 bytes (must be an envelope of at most 65536 fields)");
}

TEST(MalformedEnvelope, OfAnotherVersionIsRefused) {
  auto envelope = test::message_of<proto::Envelope>("bye {}");
  envelope.set_protocol_version(1);
  const DecodeError error = refusal_of(envelope);
  EXPECT_EQ(error.fault, DecodeFault::wrong_version);
  EXPECT_EQ(error.text, "protocol_version = 1 (must be 8)");
}

TEST(MalformedEnvelope, WithoutAMessageIsRefused) {
  const DecodeError error = refusal_of(test::message_of<proto::Envelope>(""));
  EXPECT_EQ(error.fault, DecodeFault::empty);
  EXPECT_EQ(error.text, "message = none (must be of a known kind)");
}

TEST(MalformedEnvelope, HasASessionAndOneMessage) {
  expect_refusals(
      good_welcome, "",
      {{"session: 0", "session = 0 (must not be 0)"}, {"bye {}", "message = two (must be one)"}});
}

// Hello, Reject, ResultAck.

TEST(MalformedHello, HasNamesThatMayBeLogged) {
  expect_refusals(good_hello, "hello",
                  {{"worker_name: 'a b'", "worker_name = 3" + name_rule},
                   {"host: ''", "host = 0" + name_rule},
                   {"model_version: '\\n'", "model_version = 1" + name_rule},
                   {"build: '1 2'", "build = 3" + name_rule}});
}

TEST(MalformedHello, SaysOnlyOfACrashHowTheFormerProcessEnded) {
  expect_refusals(
      good_hello, "hello.former",
      {{"session: 0", "former session = 0 (must not be 0)"},
       {"reason: LOSS_REASON_SILENT", "reason = 1 (must be one that this message may give)"},
       {"signal: 65", "former signal = 65 (must be in [0, 64])"}});
}

TEST(MalformedHello, HasABoundedNumberOfOtherModels) {
  expect_refusals(good_hello, "hello",
                  {{"other_models {}", "other_models.version = 0" + name_rule},
                   {times(65, "other_models { version: 'a-1' } "),
                    "other_models = 65 entries (must be in [0, 64])"}});
}

TEST(MalformedHello, HasSlots) {
  expect_refusals(good_hello, "hello",
                  {{"num_slots: 0", "num_slots = 0 (must be in [1, 65536])"},
                   {"num_slots: 65537", "num_slots = 65537 (must be in [1, 65536])"},
                   {"num_slots: 5 num_card_slots: 2 slots_per_thread: 4",
                    "slots_per_thread = 4 (must be in [0, 3])"},
                   {"num_card_slots: 1", "num_card_slots = 1 (must be in [0, 0])"},
                   {"cards: 'H100\\x1b'", "cards = H100? (must be printable ASCII)"},
                   {"cards: " + string_of(257), "size of cards = 257 (must be in [0, 256])"}});
}

TEST(MalformedReject, HasAKnownReasonAndABoundedText) {
  expect_refusals("reject { reason: REJECT_REASON_FULL }", "reject",
                  {{"reason: REJECT_REASON_UNSPECIFIED", "reason = 0 (must be in [1, 6])"},
                   {"text: " + string_of(4097), "text = 4097 bytes (must be at most 4096)"}});
}

TEST(MalformedResultAck, NamesRuns) {
  expect_refusals(good_ack, "result_ack",
                  {{"-runs", "runs = 0 entries (must be in [1, 4096])"},
                   {"runs: 1000000000", "run = 1000000000 (must be in [0, 999999999])"}});
}

TEST(MalformedDefinitionPart, LiesWithinTheWholeAndHasABoundedContent) {
  expect_refusals(
      good_part, "definition_part",
      {{"total_size: 0", "total_size = 0 (must be in [1, 67108864])"},
       {"total_size: 67108865", "total_size = 67108865 (must be in [1, 67108864])"},
       {"total_size: 2", "content size = 3 (must be in [1, 2])"},
       {"offset: 3", "offset = 3 (must be in [0, 2])"},
       {"offset: 18446744073709551615", "offset = 18446744073709551615 (must be in [0, 2])"},
       {"content: ''", "content size = 0 (must be in [1, 5])"},
       {"total_size: 67108864 content: " + string_of(262145),
        "content size = 262145 (must be in [1, 262144])"}});
}

TEST(MalformedCampaignRequest, AsksForAPartThatMayExist) {
  expect_refusals(good_request, "campaign_request",
                  {{"offset: 67108864", "offset = 67108864 (must be in [0, 67108863])"}});
}

TEST(MalformedForget, HasANumberOfRuns) {
  expect_refusals(good_forget, "forget",
                  {{"num_runs: 0", "num_runs = 0 (must be in [1, 1000000000])"},
                   {"num_runs: 1000000001", "num_runs = 1000000001 (must be in [1, 1000000000])"}});
}

TEST(MalformedNotServed, HasRangesOfRuns) {
  expect_refusals(
      good_not_served, "not_served",
      {{"ranges { count: 0 }", "range count = 0 (must be in [1, 1000000000])"},
       {times(4096, "ranges { count: 1 } "), "ranges = 4097 entries (must be in [0, 4096])"}});
}

TEST(MalformedCampaignNumber, IsNotZero) {
  for (const auto& [good, path] : {std::pair(good_request, "campaign_request"),
                                   {good_part, "definition_part"},
                                   {good_not_served, "not_served"},
                                   {good_forget, "forget"},
                                   {good_ack, "result_ack"},
                                   {good_retract, "retract"},
                                   {good_lease, "run_lease"},
                                   {good_batch, "result_batch"},
                                   {good_heartbeat, "heartbeat.held"},
                                   {good_heartbeat, "heartbeat.computing"}}) {
    expect_refusals(good, path, {{"campaign: 0", "campaign = 0 (must not be 0)"}});
  }
}

// Heartbeat, GiveBack, Retract, Bye.

TEST(MalformedHeartbeat, HasABoundedCredit) {
  expect_refusals(good_heartbeat, "heartbeat",
                  {{"num_runs_max: 131073", "num_runs_max = 131073 (must be in [0, 131072])"}});
}

TEST(MalformedHeartbeat, HasABoundedNumberOfRanges) {
  const std::string ranges = times(4096, "ranges { count: 1 } ");
  const std::string too_many = "number of ranges = 4097 (must be in [0, 4096])";
  expect_refusals(
      good_heartbeat, "heartbeat",
      {{times(4096, "held { " + good_runs + " } "), "held = 4097 entries (must be in [0, 4096])"},
       {times(4096, "computing { campaign: 1 ranges { count: 1 } } "),
        "computing = 4097 entries (must be in [0, 4096])"},
       {"held { campaign: 1 attempt: 1 " + ranges + "}", too_many},
       {"computing { campaign: 1 " + ranges + "}", too_many}});
}

TEST(MalformedRanges, AreThereAndWithinAnyCampaign) {
  expect_refusals(
      good_retract, "retract",
      {{"-ranges", "ranges = 0 entries (must be in [1, 4096])"},
       {times(4096, "ranges { count: 1 } "), "ranges = 4097 entries (must be in [1, 4096])"}});
  expect_refusals(good_retract, "retract.ranges",
                  {{"count: 0", "range count = 0 (must be in [1, 1000000000])"},
                   {"first: 1000000000", "range first = 1000000000 (must be in [0, 999999999])"},
                   {"first: 18446744073709551615",
                    "range first = 18446744073709551615 (must be in [0, 999999999])"}});
}

TEST(MalformedGiveBack, SaysWhatAndWhy) {
  const std::string rule = " (must be one that this message may give)";
  expect_refusals(good_give_back, "give_back",
                  {{"-runs", "runs = 0 entries (must be in [1, 4096])"},
                   {"reason: LOSS_REASON_UNSPECIFIED", "reason = 0" + rule},
                   {"reason: LOSS_REASON_HUNG", "reason = 4" + rule}});
  expect_refusals(good_give_back, "give_back.runs",
                  {{"attempt: 0", "attempt = 0 (must not be 0)"}});
  expect_refusals("bye { reason: LOSS_REASON_DRAINED }", "bye",
                  {{"reason: LOSS_REASON_HUNG", "reason = 4" + rule}});
}

// RunLease.

TEST(MalformedRunLease, HasAnAttemptAndRunsThatExist) {
  expect_refusals(good_lease, "run_lease",
                  {{"attempt: 0", "attempt = 0 (must not be 0)"},
                   {"num_runs: 0", "num_runs = 0 (must be in [1, 4096])"},
                   {"num_runs: 4097", "num_runs = 4097 (must be in [1, 4096])"},
                   {"first_run: 999999999", "first_run = 999999999 (must be in [0, 999999998])"}});
}

TEST(MalformedRunLease, HasFiniteTableValuesForEachRun) {
  expect_refusals(
      good_lease, "run_lease",
      {{"table_values: 1",
        "table_values = 3 entries (must be the same number for each run, at most 1024)"},
       {"-table_values table_values: [nan, 2]", "table_values = not finite (must be finite)"}});
}

// ResultBatch.

TEST(MalformedResultBatch, HasAttemptAndResults) {
  expect_refusals(good_batch, "result_batch",
                  {{"attempt: 0", "attempt = 0 (must not be 0)"},
                   {"-results", "results = 0 entries (must be in [1, 4096])"}});
}

TEST(MalformedComputedRun, HasAFitAndCorrelationsOfStandardErrorsInRange) {
  const std::string errors = "standard_error: " + ten_numbers;
  expect_refusals(good_batch, "result_batch.results",
                  {{errors + " fit: 1 correlation: -1", "accepted"},
                   {errors + " fit: 1 correlation: 1.5", "correlation = 1.5 (must be in [-1, 1])"},
                   {errors + " fit: -1 correlation: -1", "fit = -1 (must be in [0, 1e+90])"},
                   {"fit: 1", "fit = 1 entries (must be 0 with this status)"}});
}

TEST(MalformedComputedRun, HasHealthInRangeAndACauseIfLost) {
  const std::string lost = "-estimate status: RUN_STATUS_LOST";
  expect_refusals(good_batch, "result_batch.results",
                  {{"health: nan", "health = nan (must be in [0, 1e+90])"},
                   {"health: -1", "health = -1 (must be in [0, 1e+90])"},
                   {"loss_cause: 2", "loss_cause = 2 (must be in [0, 0])"},
                   {lost, "loss_cause = 0 (must be in [1, 255])"},
                   {lost + " loss_cause: 1", "loss_session = 0 (must be in [1, 255])"}});
}

TEST(MalformedComputedRun, HasAStatusARunIndexAndTheNumbersThatItsStatusGives) {
  expect_refusals(
      good_batch, "result_batch.results",
      {{"status: RUN_STATUS_UNSPECIFIED", "status = 0 (must be in [1, 5])"},
       {"run: 1000000000", "run = 1000000000 (must be in [0, 999999999])"},
       {"status: RUN_STATUS_NO_DRAW", "truth = 10 entries (must be 0 with this status)"},
       {"status: RUN_STATUS_NOT_FINITE", "estimate = 10 entries (must be 0 with this status)"}});
}

// The times of all results of a worker are added up and stored.
TEST(MalformedComputedRun, HasFiniteNumbers) {
  expect_refusals(good_batch, "result_batch.results",
                  {{"truth: nan", "truth = nan (must be in [-1e+90, 1e+90])"},
                   {"estimate: inf", "estimate = inf (must be in [-1e+90, 1e+90])"},
                   {"estimate: -1.1e90", "estimate = -1.1e+90 (must be in [-1e+90, 1e+90])"},
                   {"compute_s: -1", "compute_s = -1 (must be >= 0)"},
                   {"compute_s: nan", "compute_s = nan (must be >= 0)"},
                   {"compute_s: 1.7e308", "compute_s = 1.7e+308 (must be <= 1000000000)"},
                   {"elapsed_s: 1.1e9", "elapsed_s = 1100000000 (must be <= 1000000000)"},
                   {"elapsed_s: -1", "elapsed_s = -1 (must be >= 0)"}});
}

// Welcome.

TEST(MalformedWelcome, HasANumberAndAnInterval) {
  const std::string rule = " (must be in (0, 3600])";
  expect_refusals(good_welcome, "welcome",
                  {{"worker_id: 0", "worker_id = 0 (must not be 0)"},
                   {"heartbeat_interval_s: 0", "heartbeat_interval_s = 0" + rule},
                   {"heartbeat_interval_s: nan", "heartbeat_interval_s = nan" + rule},
                   {"heartbeat_interval_s: 3601", "heartbeat_interval_s = 3601" + rule}});
}

// The protocol's file names the limits, and texts for people have the numbers.
TEST(LimitsOfMessages, AreInDocumentsAsTheyAreInTheCode) {
  const auto content = [](const std::string& file) {
    std::ifstream stream(std::string(PROOFMASS_SOURCE_DIR "/") + file);
    return std::string(std::istreambuf_iterator<char>(stream), {});
  };
  std::string headers;
  for (const char* const file :
       {"proto/wire/messages.hpp", "core/campaign/definition.hpp", "core/runs.hpp"}) {
    headers += content(file);
  }
  const std::string messages = content("proto/proofmass.proto");
  const std::regex limit("//[^\n]*?([a-z_]+_max)\\b");
  std::size_t num_limits = 0;
  for (std::sregex_iterator next(messages.begin(), messages.end(), limit), end; next != end;
       ++next, ++num_limits) {
    EXPECT_THAT(headers, testing::HasSubstr(" " + next->str(1) + " = "));
  }
  EXPECT_GE(num_limits, 15U);
  EXPECT_FALSE(std::regex_search(messages, std::regex("at most [0-9]|[01] to (?!128)[0-9]{2}")));
  const std::string sizes = fmt::format(
      "{} MiB for a message to the coordinator and {} MiB to a worker or client, {} MiB for a "
      "definition, {},{:03} runs",
      router_message_size_max >> 20, message_size_max >> 20, definition_size_max >> 20,
      runs_per_lease_max / 1000, runs_per_lease_max % 1000);
  EXPECT_THAT(content("proto/README.md"), testing::HasSubstr(sizes));
  EXPECT_THAT(content("worker/README.md"),
              testing::HasSubstr(
                  fmt::format("16 slots, at most {},{:03}", slots_max / 1000, slots_max % 1000)));
}

}  // namespace
}  // namespace proofmass::wire
