// What a peer may not send: each rule of the decoder, broken by one change of a good message.

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <fstream>
#include <iterator>
#include <regex>

#include "tests/proto/wire/refusal.hpp"
#include "tests/support/messages.hpp"
#include "tests/support/microscope_results.hpp"

namespace proofmass::wire {
namespace {

using test::nan;
using test::refusal;
using test::refusal_of;

using namespace proofmass::test;

const proto::Hello good_hello = [] {
  proto::Hello hello = make_hello("w", "h", 1, "m");
  *hello.mutable_former() = make_former({1});
  return hello;
}();
const auto good_lease = make_lease({1}, {{0}, 2}, {1}, {1.0, 2.0});
const auto good_welcome = make_welcome({1}, 1.0);
const auto good_part = make_part({1}, 2, 5, 1, "abc");
const auto good_batch = [] {
  RunResult result = zero_result({});
  result.health = {1.0, 2.0, 3.0};
  return make_result_batch({1}, {1}, {{.result = result}});
}();
const std::vector<RunRange> good_runs{{{0}, 1}};
const auto good_give_back = make_give_back(LossReason::drained, {make_held({1}, {1}, good_runs)});
const auto good_heartbeat =
    make_heartbeat(1, {make_held({1}, {1}, good_runs)}, {make_computed_batch({1}, good_runs, 1)});

std::string refusal_of_run(const std::function<void(proto::ComputedRun&)>& change) {
  return refusal(good_batch, [&](auto& batch) { change(*batch.mutable_results(0)); });
}

// Envelopes.

TEST(MalformedEnvelope, OfTooManyBytesIsNotParsed) {
  const DecodeError error = refusal_of(std::string(message_size_max + 1, 'x'));
  EXPECT_EQ(error.fault, DecodeFault::too_large);
  EXPECT_EQ(error.text, "message size = 4194305 bytes (must be at most 4194304)");
}

TEST(MalformedEnvelope, ThatIsNoneIsUnparsable) {
  const DecodeError error = refusal_of("GET / HTTP/1.1");
  EXPECT_EQ(error.fault, DecodeFault::unparsable);
  EXPECT_EQ(error.text, "message = 14 bytes (must be an envelope of at most 65536 fields)");
}

// Parsed, two bytes a field would take a hundred times their size.
TEST(MalformedEnvelope, OfTooManyFieldsIsNotParsed) {
  proto::Envelope envelope;
  envelope.set_protocol_version(protocol_version);
  envelope.set_session(1);
  for (int i = 0; i < 65536; ++i) envelope.mutable_heartbeat()->add_held();
  const DecodeError error = refusal_of(envelope.SerializeAsString());
  EXPECT_EQ(error.fault, DecodeFault::unparsable);
  EXPECT_EQ(error.text, "message = 131088 bytes (must be an envelope of at most 65536 fields)");
}

TEST(MalformedEnvelope, OfAnotherVersionIsRefused) {
  proto::Envelope envelope;
  envelope.set_protocol_version(1);
  envelope.mutable_bye();
  const DecodeError error = refusal_of(envelope.SerializeAsString());
  EXPECT_EQ(error.fault, DecodeFault::wrong_version);
  EXPECT_EQ(error.text, "protocol_version = 1 (must be 8)");
}

TEST(MalformedEnvelope, WithoutAMessageIsRefused) {
  proto::Envelope envelope;
  envelope.set_protocol_version(protocol_version);
  const DecodeError error = refusal_of(envelope.SerializeAsString());
  EXPECT_EQ(error.fault, DecodeFault::empty);
  EXPECT_EQ(error.text, "message = none (must be of a known kind)");
}

TEST(MalformedEnvelope, HasASession) {
  EXPECT_EQ(refusal(in_envelope(good_welcome), [](auto& envelope) { envelope.clear_session(); }),
            "session = 0 (must not be 0)");
}

TEST(MalformedEnvelope, HasOneMessage) {
  EXPECT_EQ(refusal(in_envelope(good_welcome), [](auto& envelope) { envelope.mutable_bye(); }),
            "message = two (must be one)");
}

// Hello, Reject, ResultAck.

TEST(MalformedHello, HasNamesThatMayBeLogged) {
  EXPECT_EQ(refusal(good_hello, [](auto& hello) { hello.set_worker_name("a b"); }),
            "worker_name = 3 bytes (must be 1 to 128 of [A-Za-z0-9._-], a letter or digit first)");
  EXPECT_EQ(refusal(good_hello, [](auto& hello) { hello.set_host(""); }),
            "host = 0 bytes (must be 1 to 128 of [A-Za-z0-9._-], a letter or digit first)");
  EXPECT_EQ(
      refusal(good_hello, [](auto& hello) { hello.set_model_version("\n"); }),
      "model_version = 1 bytes (must be 1 to 128 of [A-Za-z0-9._-], a letter or digit first)");
  EXPECT_EQ(refusal(good_hello, [](auto& hello) { hello.set_build("1 2"); }),
            "build = 3 bytes (must be 1 to 128 of [A-Za-z0-9._-], a letter or digit first)");
}

TEST(MalformedHello, SaysOnlyOfACrashHowTheFormerProcessEnded) {
  EXPECT_EQ(refusal(good_hello, [](auto& hello) { hello.mutable_former()->clear_session(); }),
            "former session = 0 (must not be 0)");
  EXPECT_EQ(
      refusal(good_hello,
              [](auto& hello) { hello.mutable_former()->set_reason(proto::LOSS_REASON_SILENT); }),
      "reason = 1 (must be one that this message may give)");
  EXPECT_EQ(refusal(good_hello, [](auto& hello) { hello.mutable_former()->set_signal(65); }),
            "former signal = 65 (must be in [0, 64])");
}

TEST(MalformedHello, HasABoundedNumberOfOtherModels) {
  EXPECT_EQ(refusal(good_hello, [](auto& hello) { hello.add_other_models(); }),
            "other_models.version = 0 bytes (must be 1 to 128 of [A-Za-z0-9._-], a letter or digit "
            "first)");
  EXPECT_EQ(refusal(good_hello,
                    [](auto& hello) {
                      for (int i = 0; i < 65; ++i) hello.add_other_models()->set_version("a-1");
                    }),
            "other_models = 65 entries (must be in [0, 64])");
}

TEST(MalformedHello, HasSlots) {
  EXPECT_EQ(refusal(good_hello, [](auto& hello) { hello.set_num_slots(0); }),
            "num_slots = 0 (must be in [1, 65536])");
  EXPECT_EQ(refusal(good_hello, [](auto& hello) { hello.set_num_slots(65537); }),
            "num_slots = 65537 (must be in [1, 65536])");
  const auto with_more_a_thread = [](auto& hello) {
    hello.set_num_slots(5);
    hello.set_num_card_slots(2);
    hello.set_slots_per_thread(4);
  };
  EXPECT_EQ(refusal(good_hello, with_more_a_thread), "slots_per_thread = 4 (must be in [0, 3])");
  const auto of_cards_alone = [](auto& hello) { hello.set_num_card_slots(hello.num_slots()); };
  EXPECT_THAT(refusal(good_hello, of_cards_alone), HasSubstr("num_card_slots = "));
  EXPECT_EQ(refusal(good_hello, [](auto& hello) { hello.set_cards("H100\x1b"); }),
            "cards = H100? (must be printable ASCII)");
  EXPECT_EQ(refusal(good_hello, [](auto& hello) { hello.set_cards(std::string(257, 'x')); }),
            "size of cards = 257 (must be in [0, 256])");
}

TEST(MalformedReject, HasAKnownReasonAndABoundedText) {
  const auto good = make_reject(proto::REJECT_REASON_FULL);
  EXPECT_EQ(refusal(good, [](auto& reject) { reject.clear_reason(); }),
            "reason = 0 (must be in [1, 6])");
  EXPECT_EQ(refusal(good, [](auto& reject) { reject.set_text(std::string(4097, 'x')); }),
            "text = 4097 bytes (must be at most 4096)");
}

TEST(MalformedResultAck, NamesRuns) {
  const auto good = make_ack({1}, {{1}});
  EXPECT_EQ(refusal(good, [](auto& ack) { ack.clear_runs(); }),
            "runs = 0 entries (must be in [1, 4096])");
  EXPECT_EQ(refusal(good, [](auto& ack) { ack.add_runs(1'000'000'000); }),
            "run = 1000000000 (must be in [0, 999999999])");
}

TEST(MalformedDefinitionPart, LiesWithinTheWhole) {
  EXPECT_EQ(refusal(good_part, [](auto& part) { part.set_total_size(0); }),
            "total_size = 0 (must be in [1, 67108864])");
  EXPECT_EQ(refusal(good_part, [](auto& part) { part.set_total_size(definition_size_max + 1); }),
            "total_size = 67108865 (must be in [1, 67108864])");
  EXPECT_EQ(refusal(good_part, [](auto& part) { part.set_total_size(2); }),
            "content size = 3 (must be in [1, 2])");
  EXPECT_EQ(refusal(good_part, [](auto& part) { part.set_offset(3); }),
            "offset = 3 (must be in [0, 2])");
  EXPECT_EQ(refusal(good_part, [](auto& part) { part.set_offset(~0ULL); }),
            "offset = 18446744073709551615 (must be in [0, 2])");
}

TEST(MalformedDefinitionPart, HasABoundedContent) {
  EXPECT_EQ(refusal(good_part, [](auto& part) { part.clear_content(); }),
            "content size = 0 (must be in [1, 5])");
  EXPECT_EQ(refusal(good_part,
                    [](auto& part) {
                      part.set_total_size(definition_size_max);
                      part.set_content(std::string(definition_part_size_max + 1, 'x'));
                    }),
            "content size = 262145 (must be in [1, 262144])");
}

TEST(MalformedCampaignRequest, AsksForAPartThatMayExist) {
  EXPECT_EQ(
      refusal(make_request({1}), [](auto& request) { request.set_offset(definition_size_max); }),
      "offset = 67108864 (must be in [0, 67108863])");
}

TEST(MalformedForget, HasANumberOfRuns) {
  const auto with = [](std::uint64_t num_runs) {
    return refusal(make_forget({1}), [&](auto& forget) { forget.set_num_runs(num_runs); });
  };
  EXPECT_EQ(with(0), "num_runs = 0 (must be in [1, 1000000000])");
  EXPECT_EQ(with(num_runs_max + 1), "num_runs = 1000000001 (must be in [1, 1000000000])");
}

TEST(MalformedNotServed, HasRangesOfRuns) {
  const auto good = make_not_served({1}, good_runs);
  EXPECT_EQ(refusal(good, [](auto& not_served) { not_served.mutable_ranges(0)->set_count(0); }),
            "range count = 0 (must be in [1, 1000000000])");
  EXPECT_EQ(refusal(good,
                    [](auto& not_served) {
                      for (int i = 0; i < 4096; ++i) not_served.add_ranges()->set_count(1);
                    }),
            "ranges = 4097 entries (must be in [0, 4096])");
}

TEST(MalformedCampaignNumber, IsNotZero) {
  const std::string text = "campaign = 0 (must not be 0)";
  EXPECT_EQ(refusal(make_request({1}), [](auto& request) { request.clear_campaign(); }), text);
  EXPECT_EQ(refusal(good_part, [](auto& part) { part.clear_campaign(); }), text);
  EXPECT_EQ(refusal(make_not_served({1}), [](auto& not_served) { not_served.clear_campaign(); }),
            text);
  EXPECT_EQ(refusal(make_forget({1}), [](auto& forget) { forget.clear_campaign(); }), text);
  EXPECT_EQ(refusal(make_ack({1}, {{1}}), [](auto& ack) { ack.clear_campaign(); }), text);
  EXPECT_EQ(refusal(make_retract({1}, good_runs), [](auto& retract) { retract.clear_campaign(); }),
            text);
  EXPECT_EQ(refusal(good_lease, [](auto& lease) { lease.clear_campaign(); }), text);
  EXPECT_EQ(refusal(good_batch, [](auto& batch) { batch.clear_campaign(); }), text);
  EXPECT_EQ(
      refusal(good_heartbeat, [](auto& heartbeat) { heartbeat.mutable_held(0)->clear_campaign(); }),
      text);
  EXPECT_EQ(refusal(good_heartbeat,
                    [](auto& heartbeat) { heartbeat.mutable_computing(0)->clear_campaign(); }),
            text);
}

// Heartbeat, GiveBack, Retract, Bye.

TEST(MalformedHeartbeat, HasABoundedCredit) {
  EXPECT_EQ(refusal(good_heartbeat, [](auto& heartbeat) { heartbeat.set_num_runs_max(131073); }),
            "num_runs_max = 131073 (must be in [0, 131072])");
}

TEST(MalformedHeartbeat, HasABoundedNumberOfRanges) {
  EXPECT_EQ(refusal(good_heartbeat,
                    [](auto& heartbeat) {
                      for (int i = 0; i < 4096; ++i) *heartbeat.add_held() = heartbeat.held(0);
                    }),
            "held = 4097 entries (must be in [0, 4096])");
  EXPECT_EQ(refusal(good_heartbeat,
                    [](auto& heartbeat) {
                      for (int i = 0; i < 4096; ++i)
                        *heartbeat.add_computing() = heartbeat.computing(0);
                    }),
            "computing = 4097 entries (must be in [0, 4096])");
  const auto fill = [](auto& ranges) {
    for (int i = 0; i < 4095; ++i) *ranges.Add() = ranges.Get(0);
  };
  const std::string text = "number of ranges = 4097 (must be in [0, 4096])";
  EXPECT_EQ(refusal(good_heartbeat,
                    [&](auto& heartbeat) {
                      *heartbeat.add_held() = heartbeat.held(0);
                      fill(*heartbeat.mutable_held(1)->mutable_ranges());
                    }),
            text);
  EXPECT_EQ(refusal(good_heartbeat,
                    [&](auto& heartbeat) {
                      *heartbeat.add_computing() = heartbeat.computing(0);
                      fill(*heartbeat.mutable_computing(1)->mutable_ranges());
                    }),
            text);
}

TEST(MalformedRanges, AreThereAndWithinAnyCampaign) {
  const auto with = [](const std::function<void(proto::Retract&)>& change) {
    return refusal(make_retract({1}, good_runs), change);
  };
  EXPECT_EQ(with([](auto& retract) { retract.clear_ranges(); }),
            "ranges = 0 entries (must be in [1, 4096])");
  EXPECT_EQ(with([](auto& retract) {
              for (int i = 0; i < 4096; ++i) *retract.add_ranges() = retract.ranges(0);
            }),
            "ranges = 4097 entries (must be in [1, 4096])");
  EXPECT_EQ(with([](auto& retract) { retract.mutable_ranges(0)->clear_count(); }),
            "range count = 0 (must be in [1, 1000000000])");
  EXPECT_EQ(with([](auto& retract) { retract.mutable_ranges(0)->set_first(1'000'000'000); }),
            "range first = 1000000000 (must be in [0, 999999999])");
  EXPECT_EQ(with([](auto& retract) { retract.mutable_ranges(0)->set_first(~0ULL); }),
            "range first = 18446744073709551615 (must be in [0, 999999999])");
}

TEST(MalformedGiveBack, SaysWhatAndWhy) {
  EXPECT_EQ(refusal(good_give_back, [](auto& give_back) { give_back.clear_runs(); }),
            "runs = 0 entries (must be in [1, 4096])");
  EXPECT_EQ(refusal(good_give_back, [](auto& give_back) { give_back.clear_reason(); }),
            "reason = 0 (must be one that this message may give)");
  EXPECT_EQ(refusal(good_give_back,
                    [](auto& give_back) { give_back.set_reason(proto::LOSS_REASON_HUNG); }),
            "reason = 4 (must be one that this message may give)");
  EXPECT_EQ(
      refusal(good_give_back, [](auto& give_back) { give_back.mutable_runs(0)->clear_attempt(); }),
      "attempt = 0 (must not be 0)");
}

TEST(MalformedBye, SaysWhy) {
  EXPECT_EQ(refusal(make_bye(LossReason::drained),
                    [](auto& bye) { bye.set_reason(proto::LOSS_REASON_HUNG); }),
            "reason = 4 (must be one that this message may give)");
}

// RunLease.

TEST(MalformedRunLease, HasAnAttempt) {
  EXPECT_EQ(refusal(good_lease, [](auto& lease) { lease.set_attempt(0); }),
            "attempt = 0 (must not be 0)");
}

TEST(MalformedRunLease, HasRunsThatExist) {
  EXPECT_EQ(refusal(good_lease, [](auto& lease) { lease.set_num_runs(0); }),
            "num_runs = 0 (must be in [1, 4096])");
  EXPECT_EQ(refusal(good_lease, [](auto& lease) { lease.set_num_runs(4097); }),
            "num_runs = 4097 (must be in [1, 4096])");
  EXPECT_EQ(refusal(good_lease, [](auto& lease) { lease.set_first_run(999'999'999); }),
            "first_run = 999999999 (must be in [0, 999999998])");
}

TEST(MalformedRunLease, HasFiniteTableValuesForEachRun) {
  EXPECT_EQ(refusal(good_lease, [](auto& lease) { lease.add_table_values(1.0); }),
            "table_values = 3 entries (must be the same number for each run, at most 1024)");
  EXPECT_EQ(refusal(good_lease, [](auto& lease) { lease.set_table_values(0, nan); }),
            "table_values = not finite (must be finite)");
}

// ResultBatch.

TEST(MalformedResultBatch, HasAttemptAndResults) {
  EXPECT_EQ(refusal(good_batch, [](auto& batch) { batch.set_attempt(0); }),
            "attempt = 0 (must not be 0)");
  EXPECT_EQ(refusal(good_batch, [](auto& batch) { batch.clear_results(); }),
            "results = 0 entries (must be in [1, 4096])");
}

TEST(MalformedComputedRun, HasAFitAndCorrelationsOfStandardErrorsInRange) {
  const auto with = [](int num_errors, double chi_squared) {
    return [=](auto& run) {
      for (int i = 0; i < num_errors; ++i) run.add_standard_error(1.0);
      run.add_fit(chi_squared);
      run.add_correlation(-1.0);
    };
  };
  EXPECT_EQ(refusal_of_run(with(10, 1.0)), "accepted");
  EXPECT_EQ(refusal_of_run([&](auto& run) {
              with(10, 1.0)(run);
              run.set_correlation(0, 1.5);
            }),
            "correlation = 1.5 (must be in [-1, 1])");
  EXPECT_EQ(refusal_of_run(with(10, -1.0)), "fit = -1 (must be in [0, 1e+90])");
  EXPECT_EQ(refusal_of_run(with(0, 1.0)), "fit = 1 entries (must be 0 with this status)");
}

TEST(MalformedComputedRun, HasHealthInRangeAndACauseIfLost) {
  EXPECT_EQ(refusal_of_run([](auto& run) { run.set_health(1, nan); }),
            "health = nan (must be in [0, 1e+90])");
  EXPECT_EQ(refusal_of_run([](auto& run) { run.set_health(2, -1.0); }),
            "health = -1 (must be in [0, 1e+90])");
  EXPECT_EQ(refusal_of_run([](auto& run) { run.set_loss_cause(2); }),
            "loss_cause = 2 (must be in [0, 0])");
  const auto lose = [](auto& run) {
    run.set_status(proto::RUN_STATUS_LOST);
    run.clear_estimate();
  };
  EXPECT_EQ(refusal_of_run(lose), "loss_cause = 0 (must be in [1, 255])");
  EXPECT_EQ(refusal_of_run([&](auto& run) {
              lose(run);
              run.set_loss_cause(1);
            }),
            "loss_session = 0 (must be in [1, 255])");
}

TEST(MalformedComputedRun, HasAStatusAndARunIndex) {
  EXPECT_EQ(refusal_of_run([](auto& run) { run.clear_status(); }),
            "status = 0 (must be in [1, 5])");
  EXPECT_EQ(refusal_of_run([](auto& run) { run.set_run(1'000'000'000); }),
            "run = 1000000000 (must be in [0, 999999999])");
}

TEST(MalformedComputedRun, HasTheNumbersThatItsStatusGives) {
  EXPECT_EQ(refusal_of_run([](auto& run) { run.set_status(proto::RUN_STATUS_NO_DRAW); }),
            "truth = 10 entries (must be 0 with this status)");
  EXPECT_EQ(refusal_of_run([](auto& run) { run.set_status(proto::RUN_STATUS_NOT_FINITE); }),
            "estimate = 10 entries (must be 0 with this status)");
}

TEST(MalformedComputedRun, HasFiniteNumbers) {
  EXPECT_EQ(refusal_of_run([](auto& run) { run.set_truth(3, nan); }),
            "truth = nan (must be in [-1e+90, 1e+90])");
  EXPECT_EQ(refusal_of_run([](auto& run) { run.set_estimate(3, 1.0 / 0.0); }),
            "estimate = inf (must be in [-1e+90, 1e+90])");
  EXPECT_EQ(refusal_of_run([](auto& run) { run.set_estimate(9, -1.1e90); }),
            "estimate = -1.1e+90 (must be in [-1e+90, 1e+90])");
  EXPECT_EQ(refusal_of_run([](auto& run) { run.set_compute_s(-1.0); }),
            "compute_s = -1 (must be >= 0)");
  EXPECT_EQ(refusal_of_run([](auto& run) { run.set_compute_s(nan); }),
            "compute_s = nan (must be >= 0)");
  // The times of all results of a worker are added up and stored.
  EXPECT_EQ(refusal_of_run([](auto& run) { run.set_compute_s(1.7e308); }),
            "compute_s = 1.7e+308 (must be <= 1000000000)");
  EXPECT_EQ(refusal_of_run([](auto& run) { run.set_elapsed_s(1.1e9); }),
            "elapsed_s = 1100000000 (must be <= 1000000000)");
  EXPECT_EQ(refusal_of_run([](auto& run) { run.set_elapsed_s(-1.0); }),
            "elapsed_s = -1 (must be >= 0)");
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

// Welcome.

TEST(MalformedWelcome, HasANumberAndAnInterval) {
  EXPECT_EQ(refusal(good_welcome, [](auto& welcome) { welcome.set_worker_id(0); }),
            "worker_id = 0 (must not be 0)");
  for (const auto& [value, text] : {std::pair{0.0, "0"}, {nan, "nan"}, {3601.0, "3601"}}) {
    EXPECT_EQ(
        refusal(good_welcome, [&](auto& welcome) { welcome.set_heartbeat_interval_s(value); }),
        std::string("heartbeat_interval_s = ") + text + " (must be in (0, 3600])");
  }
}

}  // namespace
}  // namespace proofmass::wire
