#include "proto/wire/codec.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <limits>
#include <memory>
#include <random>
#include <variant>

#include "core/error.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "proto/wire/definition_codec.hpp"
#include "tests/support/microscope_results.hpp"

namespace proofmass::wire {
namespace {

std::uint64_t bits(double value) { return std::bit_cast<std::uint64_t>(value); }

constexpr Header some_header{
    .session = {0xffff'ffff'ffff'fff1}, .epoch = {1ULL << 63}, .sequence = 1ULL << 40};

template <typename Content>
Content round_trip(const Content& content) {
  const auto decoded = decode(encode({.header = some_header, .message = content}));
  if (const auto* const error = std::get_if<DecodeError>(&decoded)) {
    throw Error("not decoded: " + error->text);
  }
  const Packet& packet = std::get<Packet>(decoded);
  EXPECT_EQ(packet.header, some_header);
  return std::get<Content>(packet.message);
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
  result = test::zero_result(std::move(result));
  for (std::size_t i = 0; i < num_parameters; ++i) {
    if (result.has_truth()) result.truth[i] = hard_numbers[i % hard_numbers.size()];
    if (result.has_estimate()) result.estimate[i] = 1.0 / (3.0 + static_cast<double>(i));
  }
  if (result.has_truth()) result.health = test::values_of({1e-7, 2e-5, 1.1e-12, 3e-4, 1e90});
  if (status == RunStatus::lost)
    result.loss = test::loss_of(LossCause::residual, SessionTarget::k2_sensor_2);
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

const Hello some_hello{.worker_name = "w-1",
                       .host = "h",
                       .process_id = 1ULL << 40,
                       .num_slots = 2,
                       .model_version = "m-1",
                       .build = "1.0",
                       .reference_digest = 0xdead'beef'0000'0001,
                       .former = {}};

TEST(Codec, KeepsAHello) {
  const Hello hello = round_trip(some_hello);
  EXPECT_EQ(hello.worker_name, "w-1");
  EXPECT_EQ(hello.host, "h");
  EXPECT_EQ(hello.process_id, 1ULL << 40);
  EXPECT_EQ(hello.num_slots, 2U);
  EXPECT_EQ(hello.model_version, "m-1");
  EXPECT_EQ(hello.build, "1.0");
  EXPECT_EQ(hello.reference_digest, 0xdead'beef'0000'0001);
  EXPECT_FALSE(hello.former);
}

TEST(Codec, KeepsHowTheFormerProcessEnded) {
  Hello hello = some_hello;
  hello.former = FormerSession{.session = {77}, .reason = LossReason::out_of_memory, .signal = 9};
  const auto former = round_trip(hello).former;
  ASSERT_TRUE(former);
  EXPECT_EQ(former->session, SessionId{77});
  EXPECT_EQ(former->reason, LossReason::out_of_memory);
  EXPECT_EQ(former->signal, 9U);
}

TEST(Codec, KeepsAWelcome) {
  const Welcome welcome = round_trip(Welcome{.worker = {5}, .heartbeat_interval_s = 0.1});
  EXPECT_EQ(welcome.worker, WorkerId{5});
  EXPECT_EQ(bits(welcome.heartbeat_interval_s), bits(0.1));
}

MicroscopeCampaign definition_round_trip(const MicroscopeCampaign& campaign) {
  const Definition sent = definition_of(campaign, TableColumns::left_out);
  return campaign_of(std::get<Definition>(decode_definition(encode_definition(sent))),
                     TableColumns::left_out);
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

TEST(Codec, KeepsAPartOfADefinition) {
  const DefinitionPart part = round_trip(DefinitionPart{
      .campaign = {6}, .offset = 5, .total_size = 8, .checksum = ~0ULL, .content = {"\0\xff", 2}});
  EXPECT_EQ(part.campaign, CampaignId{6});
  EXPECT_EQ(part.offset, 5U);
  EXPECT_EQ(part.total_size, 8U);
  EXPECT_EQ(part.checksum, ~0ULL);
  EXPECT_EQ(part.content, std::string("\0\xff", 2));
}

TEST(Codec, KeepsARejectWithItsReason) {
  const Reject reject = round_trip(Reject{.reason = RejectReason::full, .text = "full"});
  EXPECT_EQ(reject.reason, RejectReason::full);
  EXPECT_EQ(reject.text, "full");
}

TEST(Codec, KeepsWhichCampaignIsMeant) {
  const CampaignRequest request = round_trip(CampaignRequest{.campaign = {9}, .offset = 1234567});
  EXPECT_EQ(request.campaign, CampaignId{9});
  EXPECT_EQ(request.offset, 1234567U);
  const Forget forget = round_trip(Forget{.campaign = {1ULL << 63}, .num_runs = 12});
  EXPECT_EQ(forget.campaign, CampaignId{1ULL << 63});
  EXPECT_EQ(forget.num_runs, 12U);
}

TEST(Codec, KeepsWhichRunsAreNotServed) {
  const std::vector<RunRange> ranges{{{5}, 2}, {{9}, 1}};
  const NotServed some = round_trip(NotServed{.campaign = {9}, .ranges = ranges});
  EXPECT_EQ(some.campaign, CampaignId{9});
  EXPECT_EQ(some.ranges, ranges);
  EXPECT_TRUE(round_trip(NotServed{.campaign = {9}, .ranges = {}}).ranges.empty()) << "all";
}

TEST(Codec, KeepsALeaseWithItsTableValues) {
  const RunLease lease =
      round_trip(RunLease{.campaign = {9},
                          .runs = {.first = {100}, .count = 5},
                          .attempt = {2},
                          .is_alone = true,
                          .batch_runs_max = 7,
                          .table_values = {hard_numbers.begin(), hard_numbers.end()}});
  EXPECT_EQ(lease.campaign, CampaignId{9});
  EXPECT_TRUE(lease.is_alone);
  EXPECT_EQ(lease.batch_runs_max, 7U);
  EXPECT_EQ(lease.runs, (RunRange{.first = {100}, .count = 5}));
  EXPECT_EQ(lease.attempt, Attempt{2});
  ASSERT_EQ(lease.table_values.size(), hard_numbers.size());
  for (std::size_t i = 0; i < hard_numbers.size(); ++i) {
    EXPECT_EQ(bits(lease.table_values[i]), bits(hard_numbers[i]));
  }
}

TEST(Codec, KeepsEveryBitOfResultsOfEachStatus) {
  ResultBatch sent{.campaign = {3}, .attempt = {1}, .results = {}};
  for (const RunStatus status : {RunStatus::completed, RunStatus::not_converged,
                                 RunStatus::not_finite, RunStatus::no_draw, RunStatus::lost}) {
    sent.results.push_back({.result = some_result({sent.results.size()}, status),
                            .compute_s = 2.5,
                            .elapsed_s = 40.0});
  }
  const ResultBatch got = round_trip(sent);
  EXPECT_EQ(got.campaign, sent.campaign);
  EXPECT_EQ(got.attempt, sent.attempt);
  ASSERT_EQ(got.results.size(), 5U);
  for (std::size_t run = 0; run < 5; ++run) {
    const RunResult& a = got.results[run].result;
    const RunResult& b = sent.results[run].result;
    EXPECT_EQ(a.run, b.run);
    EXPECT_EQ(a.status, b.status);
    EXPECT_EQ(a.health, b.health);
    EXPECT_EQ(a.loss, b.loss);
    EXPECT_EQ(a.num_draws, 3U);
    EXPECT_EQ(a.num_rounds, 7U);
    EXPECT_EQ(got.results[run].compute_s, 2.5);
    EXPECT_EQ(got.results[run].elapsed_s, 40.0);
    ASSERT_EQ(a.truth.size(), b.truth.size());
    ASSERT_EQ(a.estimate.size(), b.estimate.size());
    for (std::size_t i = 0; i < a.truth.size(); ++i) EXPECT_EQ(bits(a.truth[i]), bits(b.truth[i]));
    for (std::size_t i = 0; i < a.estimate.size(); ++i) {
      EXPECT_EQ(bits(a.estimate[i]), bits(b.estimate[i]));
    }
  }
}

TEST(Codec, KeepsAnAcknowledgement) {
  const ResultAck ack = round_trip(ResultAck{.campaign = {3}, .runs = {{0}, {7}}});
  EXPECT_EQ(ack.campaign, CampaignId{3});
  EXPECT_EQ(ack.runs, (std::vector<RunIndex>{{0}, {7}}));
}

const HeldRuns some_runs{.campaign = {3},
                         .attempt = {2},
                         .ranges = {{.first = {5}, .count = 1}, {.first = {9}, .count = 90}}};

TEST(Codec, KeepsWhatIsRetractedAndGivenBack) {
  const Retract retract = round_trip(Retract{.campaign = {3}, .ranges = some_runs.ranges});
  EXPECT_EQ(retract.campaign, CampaignId{3});
  EXPECT_EQ(retract.ranges, some_runs.ranges);
  const GiveBack give_back =
      round_trip(GiveBack{.reason = LossReason::walltime, .runs = {some_runs}});
  EXPECT_EQ(give_back.reason, LossReason::walltime);
  EXPECT_EQ(give_back.runs, std::vector{some_runs});
}

TEST(Codec, KeepsAHeartbeat) {
  const ComputedBatch batch{
      .campaign = {3}, .ranges = {{.first = {9}, .count = 2}}, .num_steps_done = 139};
  const Heartbeat heartbeat = round_trip(Heartbeat{.num_runs_max = 4096,
                                                   .num_steps_done = 1ULL << 33,
                                                   .held = {some_runs, some_runs},
                                                   .computing = {batch}});
  EXPECT_EQ(heartbeat.num_runs_max, 4096U);
  EXPECT_EQ(heartbeat.num_steps_done, 1ULL << 33);
  EXPECT_EQ(heartbeat.held, (std::vector{some_runs, some_runs}));
  EXPECT_EQ(heartbeat.computing, std::vector{batch});
}

TEST(Codec, KeepsWhyAWorkerLeaves) {
  EXPECT_EQ(round_trip(Bye{.reason = LossReason::walltime}).reason, LossReason::walltime);
}

TEST(Codec, KeepsTheKindOfAMessageWithoutContent) {
  EXPECT_NO_THROW((void)round_trip(HeartbeatAck{}));
  EXPECT_NO_THROW((void)round_trip(Drain{}));
  EXPECT_NO_THROW((void)round_trip(Stop{}));
}

// Around the text are 39 bytes: version 2, session and epoch 9 each, sequence 7, reason 2, and tag
// and length of text and message 5 each.
TEST(Codec, DoesNotEncodeMoreThanMayBeSent) {
  Reject reject{.reason = RejectReason::full, .text = std::string(message_size_max, 'x')};
  try {
    (void)encode({.header = some_header, .message = reject});
    FAIL();
  } catch (const InvalidArgument& error) {
    EXPECT_EQ(std::string(error.what()), "message size = 4194343 bytes (must be at most 4194304)");
  }
}

// The largest lease and the largest batch of results must fit, or a campaign could stand still.
TEST(Codec, HasRoomForTheLargestLeaseAndBatch) {
  const RunLease lease{.campaign = {1},
                       .runs = {.first = {0}, .count = runs_per_lease_max},
                       .attempt = {1},
                       .is_alone = false,
                       .table_values = std::vector<double>(runs_per_lease_max * num_drawn, 0.1)};
  EXPECT_EQ(round_trip(lease).table_values.size(), lease.table_values.size());

  ResultBatch batch{.campaign = {~0ULL}, .attempt = {~0U}, .results = {}};
  for (std::uint64_t i = 0; i < runs_per_lease_max; ++i) {
    batch.results.push_back(
        {.result = some_result({num_runs_max - 1 - i}, RunStatus::completed), .compute_s = 0.1});
  }
  EXPECT_EQ(round_trip(batch).results.size(), batch.results.size());
}

std::string encoded_part() {
  const EncodedDefinition definition(definition_of(unusual_campaign()));
  return encode({.header = some_header, .message = definition.part({.campaign = {6}})});
}

TEST(Codec, SurvivesAnyTruncation) {
  const std::string bytes = encoded_part();
  const std::string definition = encode_definition(definition_of(unusual_campaign()));
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    const auto decoded = decode(std::string_view(bytes).substr(0, size));
    ASSERT_TRUE(std::holds_alternative<DecodeError>(decoded)) << size;
  }
  for (std::size_t size = 0; size < definition.size(); ++size) {
    const auto decoded = decode_definition(std::string_view(definition).substr(0, size));
    const auto* const part = std::get_if<Definition>(&decoded);
    // Where a table is missing, what is left has the form of a definition.
    if (part == nullptr) continue;
    EXPECT_THROW((void)campaign_of(*part, TableColumns::left_out), DefinitionError) << size;
  }
}

// Not a proof of safety, but it runs under the sanitizers too. The seed is fixed.
TEST(Codec, SurvivesRandomBytesAndRandomDamage) {
  std::mt19937_64 random(20130104);
  const ResultBatch batch{
      .campaign = {3},
      .attempt = {1},
      .results = {{.result = some_result({1}, RunStatus::completed), .compute_s = 1.0}}};
  const std::array<std::string, 4> good{encode_definition(definition_of(unusual_campaign())),
                                        encode({.header = some_header, .message = batch}),
                                        encode({.header = some_header,
                                                .message = Heartbeat{.num_runs_max = 1,
                                                                     .num_steps_done = 5,
                                                                     .held = {some_runs},
                                                                     .computing = {}}}),
                                        encoded_part()};
  std::size_t num_refused = 0;
  for (int i = 0; i < 20000; ++i) {
    std::string bytes = good[random() % good.size()];
    if (i % 4 == 0) {
      bytes.resize(random() % 200);
      for (char& byte : bytes) byte = static_cast<char>(random());
    }
    for (std::uint64_t hits = random() % 4; hits > 0 && !bytes.empty(); --hits) {
      bytes[random() % bytes.size()] = static_cast<char>(random());
    }
    const bool is_refused = std::holds_alternative<DecodeError>(decode(bytes));
    if (is_refused && std::holds_alternative<DecodeError>(decode_definition(bytes))) ++num_refused;
  }
  EXPECT_GT(num_refused, 5000U);
}

}  // namespace
}  // namespace proofmass::wire
