#include "proto/wire/codec.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <functional>
#include <limits>
#include <variant>

#include "core/error.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "proto/wire/definition_codec.hpp"
#include "tests/support/messages.hpp"
#include "tests/support/microscope_results.hpp"

namespace proofmass::wire {
namespace {

std::uint64_t bits(double value) { return std::bit_cast<std::uint64_t>(value); }

using namespace proofmass::test;

template <typename Content>
proto::Envelope addressed(const Content& content) {
  proto::Envelope envelope = in_envelope(content);
  envelope.set_session(0xffff'ffff'ffff'fff1);
  envelope.set_epoch(1ULL << 63);
  envelope.set_sequence(1ULL << 40);
  return envelope;
}

template <typename Content>
std::string encoded(const Content& content) {
  return encode(addressed(content));
}

/// What a peer hears of a message.
template <typename Content>
Content round_trip(const Content& content) {
  const auto decoded = decode(encoded(content));
  if (const auto* const error = std::get_if<DecodeError>(&decoded)) {
    throw Error("not decoded: " + error->text);
  }
  proto::Envelope expected = addressed(content);
  expected.set_protocol_version(protocol_version);
  EXPECT_EQ(std::get<proto::Envelope>(decoded), expected);
  return content_of<Content>(std::get<proto::Envelope>(decoded));
}

/// Numbers of which text or single precision would lose bits.
constexpr std::array<double, 5> hard_numbers{0.1, 1e-300, -2.0 / 3.0,
                                             std::numeric_limits<double>::denorm_min(), -0.0};

RunResult some_result(RunIndex run, RunStatus status) {
  RunResult result;
  result.run = run;
  result.status = status;
  result.num_draws = 3;
  result.num_rounds = 7;
  result = zero_result(std::move(result));
  for (std::size_t i = 0; i < num_parameters; ++i) {
    if (result.has_truth()) result.truth[i] = hard_numbers[i % hard_numbers.size()];
    if (result.has_estimate()) result.estimate[i] = 1.0 / (3.0 + static_cast<double>(i));
  }
  if (result.has_truth()) result.health = values_of({1e-7, 2e-5, 1.1e-12, 3e-4, 1e90});
  if (status == RunStatus::completed) {
    result.standard_error.assign(num_parameters, 1.0 / 3.0);
    result.fit = {37.0 / 3.0, hard_numbers[0] * hard_numbers[0]};
    result.correlations.assign(45, -1.0 / 3.0);
  }
  if (status == RunStatus::lost)
    result.loss = loss_of(LossCause::residual, SessionTarget::k2_sensor_2);
  return result;
}

/// Every number of the scenario's fields, in order, as bits.
std::vector<std::uint64_t> field_bits(const Scenario& scenario) {
  std::vector<std::uint64_t> all;
  for_each_field(scenario, [&](const FieldInfo&, const auto& value) {
    using Value = std::decay_t<decltype(value)>;
    if constexpr (std::is_same_v<Value, double>) {
      all.push_back(bits(value));
    } else {
      all.push_back(static_cast<std::uint64_t>(value));
    }
  });
  return all;
}

MicroscopeCampaign unusual_campaign() {
  MicroscopeCampaign campaign;
  campaign.name = "unusual";
  campaign.seed = seed_max - 1;
  campaign.num_runs = 12345;
  campaign.scenario.noise.scale = 0.1;
  campaign.scenario.estimation.correction = Correction::first_order;
  campaign.scenario.estimation.num_rounds_max = 9;
  campaign.scenario.environment.kind = EnvironmentKind::file;
  campaign.environment_file = "drag.csv";
  for (int i = 0; i <= 12; ++i) {
    campaign.environment_table.push_back({.time_s = 500.0 * i,
                                          .linear_m_s2 = {1e-8 / (i + 1), -0.0, 3e-9},
                                          .angular_rad_s2 = {1e-11, 2e-11, 1e-300}});
  }
  campaign.dispersions[0] = {
      .law = Law::normal, .mean = 1e-3, .standard_deviation = 1e-4, .file = {}, .column = {}};
  campaign.dispersions[7] = {.law = Law::table, .file = "values.csv", .column = "a"};
  return campaign;
}

MicroscopeCampaign definition_round_trip(const MicroscopeCampaign& campaign) {
  const Definition sent = definition_of(campaign, TableColumns::left_out);
  return campaign_of(decode_definition(encode_definition(sent)), TableColumns::left_out);
}

TEST(Codec, KeepsEveryBitOfACampaign) {
  MicroscopeCampaign sent = unusual_campaign();
  Session& shaken_twice = sent.scenario.sessions[7];
  shaken_twice.excitations.push_back({ExcitationKind::attitude, Axis::z, 1e-3, 7e-4});
  shaken_twice.known_lines.push_back({.orbital = 1.0, .further = {2.5, 0.0, 0.0}});
  const MicroscopeCampaign got = definition_round_trip(sent);
  EXPECT_EQ(got.name, sent.name);
  EXPECT_EQ(got.seed, sent.seed);
  EXPECT_EQ(got.num_runs, sent.num_runs);
  EXPECT_EQ(field_bits(got.scenario), field_bits(sent.scenario));
  EXPECT_EQ(got.scenario.sessions, sent.scenario.sessions);
  EXPECT_EQ(got.dispersions, sent.dispersions);
  EXPECT_EQ(got.environment_file, sent.environment_file);
  EXPECT_EQ(got.environment_table, sent.environment_table);
  EXPECT_TRUE(std::signbit(got.environment_table[0].linear_m_s2[1]));
}

TEST(Codec, LeavesTableColumnsOut) {
  MicroscopeCampaign campaign = unusual_campaign();
  campaign.table_columns = {std::vector<double>(12345, 1e-3)};
  EXPECT_TRUE(definition_round_trip(campaign).table_columns.empty());
}

// One of each kind; round_trip() compares what arrives.
TEST(Codec, TakesEveryMessageThatMayBeSent) {
  const std::vector<RunRange> ranges{{{5}, 1}, {{9}, 90}};
  const auto held = make_held({3}, {2}, ranges);
  proto::Hello hello = make_hello("w-1", "h", 2, "m-1");
  (void)round_trip(hello);
  *hello.mutable_former() = make_former({77}, LossReason::out_of_memory);
  (void)round_trip(hello);
  (void)round_trip(make_welcome({5}, 0.1));
  (void)round_trip(make_reject(proto::REJECT_REASON_FULL, "full"));
  (void)round_trip(make_request({9}, 1234567));
  (void)round_trip(make_part({6}, 5, 8, ~0ULL, {"\0\xff", 2}));
  (void)round_trip(make_forget({1ULL << 63}, 12));
  (void)round_trip(make_not_served({9}));
  (void)round_trip(make_not_served({9}, ranges));
  (void)round_trip(make_retract({3}, ranges));
  (void)round_trip(make_give_back(LossReason::walltime, {held}));
  (void)round_trip(make_ack({3}, {{0}, {7}}));
  proto::Heartbeat heartbeat =
      make_heartbeat(4096, {held, held}, {make_computed_batch({3}, {{{9}, 2}}, 139)});
  *heartbeat.add_set_aside() = held;
  (void)round_trip(heartbeat);
  (void)round_trip(make_bye(LossReason::walltime));
  (void)round_trip(proto::HeartbeatAck());
  (void)round_trip(proto::Drain());
  (void)round_trip(proto::Stop());
}

TEST(Codec, KeepsEveryBitOfTableValues) {
  const std::vector<double> sent(hard_numbers.begin(), hard_numbers.end());
  const auto got = round_trip(make_lease({9}, {{100}, 5}, {2}, sent)).table_values();
  EXPECT_TRUE(std::ranges::equal(got, sent, {}, bits, bits));
}

TEST(Codec, KeepsEveryBitOfResultsOfEachStatus) {
  for (const RunStatus status : {RunStatus::completed, RunStatus::not_converged,
                                 RunStatus::not_finite, RunStatus::no_draw, RunStatus::lost}) {
    const ComputedRun sent{.result = some_result({7}, status), .compute_s = 2.5, .elapsed_s = 40.0};
    const ComputedRun got =
        computed_run(round_trip(make_result_batch({3}, {1}, {sent})).results(0));
    EXPECT_EQ(got.result.run, sent.result.run);
    EXPECT_EQ(got.result.status, sent.result.status);
    EXPECT_EQ(got.result.health, sent.result.health);
    EXPECT_EQ(got.result.standard_error, sent.result.standard_error);
    EXPECT_EQ(got.result.fit, sent.result.fit);
    EXPECT_EQ(got.result.correlations, sent.result.correlations);
    EXPECT_EQ(got.result.loss, sent.result.loss);
    EXPECT_EQ(got.result.num_draws, 3U);
    EXPECT_EQ(got.result.num_rounds, 7U);
    EXPECT_EQ(got.compute_s, 2.5);
    EXPECT_EQ(got.elapsed_s, 40.0);
    EXPECT_TRUE(std::ranges::equal(got.result.truth, sent.result.truth, {}, bits, bits));
    EXPECT_TRUE(std::ranges::equal(got.result.estimate, sent.result.estimate, {}, bits, bits));
  }
}

TEST(Codec, MakesTextsForPeoplePrintable) {
  const auto decoded = decode(encoded(make_reject(proto::REJECT_REASON_FULL, "a\033b")));
  EXPECT_EQ(std::get<proto::Envelope>(decoded).reject().text(), "a?b");
}

// Around the text are 39 bytes: version 2, session and epoch 9 each, sequence 7, reason 2, and tag
// and length of text and message 5 each.
TEST(Codec, DoesNotEncodeMoreThanMayBeSent) {
  try {
    (void)encoded(make_reject(proto::REJECT_REASON_FULL, std::string(message_size_max, 'x')));
    FAIL();
  } catch (const InvalidArgument& error) {
    EXPECT_EQ(std::string(error.what()), "message size = 4194343 bytes (must be at most 4194304)");
  }
}

// The largest lease and the largest batch of results must fit, or a campaign could stand still.
TEST(Codec, HasRoomForTheLargestLeaseAndBatch) {
  const std::vector<double> values(runs_per_lease_max * num_drawn, 0.1);
  (void)round_trip(make_lease({1}, {{0}, runs_per_lease_max}, {1}, values));

  std::vector<ComputedRun> results;
  for (std::uint64_t i = 0; i < runs_per_lease_max; ++i) {
    results.push_back(
        {.result = some_result({num_runs_max - 1 - i}, RunStatus::completed), .compute_s = 0.1});
  }
  (void)round_trip(make_result_batch({~0ULL}, {~0U}, results));
}

// What is larger than a coordinator's socket takes is never delivered: a run of 63 quantities with
// standard errors has 17 kB, one that is lost a few bytes.
TEST(ResultBatches, FitIntoWhatACoordinatorTakes) {
  ComputedRun large{.result = some_result({1}, RunStatus::completed), .compute_s = 0.1};
  large.result.correlations.assign(63 * 62 / 2, 0.5);
  const ComputedRun small{.result = {.run = {1}, .status = RunStatus::lost}, .compute_s = 0.1};
  for (const auto& is_large : std::vector<std::function<bool(int)>>{
           [](int) { return true; }, [](int i) { return i < 60; }, [](int i) { return i > 4000; },
           [](int i) { return i % 3 == 0; }}) {
    ResultBatches batches;
    std::size_t num_sent = 0;
    for (int i = 0; i < 5000; ++i) {
      batches.add({.campaign = {1}, .attempt = {1}, .computed = is_large(i) ? large : small});
    }
    for (proto::ResultBatch& batch : batches.take()) {
      num_sent += static_cast<std::size_t>(batch.results_size());
      proto::Envelope envelope;
      envelope.set_session(~0ULL);
      *envelope.mutable_result_batch() = std::move(batch);
      EXPECT_LE(encode(std::move(envelope)).size(), router_message_size_max);
    }
    EXPECT_EQ(num_sent, 5000U);
  }
}

TEST(ResultBatches, HaveAsManyResultsAsALeaseAtMost) {
  const ComputedRun small{.result = {.run = {1}, .status = RunStatus::lost}, .compute_s = 0.1};
  ResultBatches batches;
  for (std::uint32_t i = 0; i <= runs_per_lease_max; ++i) {
    batches.add({.campaign = {1}, .attempt = {1}, .computed = small});
  }
  const std::vector<proto::ResultBatch> taken = batches.take();
  ASSERT_EQ(taken.size(), 2U);
  EXPECT_EQ(taken[0].results_size(), runs_per_lease_max);
}

}  // namespace
}  // namespace proofmass::wire
