// The same bits from every compiler option, optimisation level and processor, ARM64 included. The
// numbers were made by the release build on x86-64. They change only with the model, together with
// model_version.

#include "core/math/elementary.hpp"
#include "core/math/hash.hpp"
#include "core/microscope/simulation/reference_digest.hpp"
#include "core/microscope/simulation/run.hpp"
#include "core/random/normal_deviates.hpp"
#include "core/random/stream.hpp"
#include "core/signal/noise_shape.hpp"
#include "tests/support/runs.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

/// FNV-1a over the words of numbers.
class Hash {
 public:
  void add(double value) { value_ = fnv1a(value_, std::bit_cast<std::uint64_t>(value)); }
  void add(float value) { value_ = fnv1a(value_, std::bit_cast<std::uint32_t>(value)); }
  void add(std::uint32_t word) { value_ = fnv1a(value_, word); }
  void add(std::span<const double> values) {
    for (const double value : values) add(value);
  }
  void add(const SineCosine& pair) {
    add(pair.sine);
    add(pair.cosine);
  }
  void add(const ComplexDouble& number) {
    add(number.real());
    add(number.imag());
  }
  [[nodiscard]] std::uint64_t value() const { return value_; }

 private:
  std::uint64_t value_ = fnv1a_basis;
};

constexpr std::uint32_t num_arguments = 20'000;

TEST(ElementaryFunctions, HaveTheRecordedBits) {
  const RandomStream stream(20131121, RunIndex{1}, stream_id("arguments"));
  Hash trigonometric, exponentials, logarithms, normals;
  for (std::uint32_t i = 0; i < num_arguments; ++i) {
    const double u = uniform(stream.block(i));
    const double centred = 2.0 * u - 1.0;
    trigonometric.add(sincos_turns(centred));
    trigonometric.add(sincos_turns(1e6 * centred));
    trigonometric.add(sincos(1e3 * centred));
    exponentials.add(exponential(centred));
    exponentials.add(exponential(700.0 * centred));
    logarithms.add(logarithm(u));
    logarithms.add(logarithm(1.0 + centred / 16.0));
    logarithms.add(logarithm(1e200 * u));
    normals.add(inverse_normal(u));
    normals.add(inverse_normal(1e-12 * u));
  }
  EXPECT_EQ(trigonometric.value(), 0x3b5df60cc587c1bU) << std::hex << trigonometric.value();
  EXPECT_EQ(exponentials.value(), 0xb2bf38b6a887aa11U) << std::hex << exponentials.value();
  EXPECT_EQ(logarithms.value(), 0x7e240bdb4b2306a1U) << std::hex << logarithms.value();
  EXPECT_EQ(normals.value(), 0xfab9c8b22d78ecdU) << std::hex << normals.value();
}

TEST(RandomStream, HasTheRecordedBits) {
  const RandomStream stream(0xfedcba9876543210U, RunIndex{(1ULL << 40) + 3}, stream_id("words"));
  Hash words, deviates;
  for (std::uint32_t i = 0; i < num_arguments; ++i) {
    const RandomBlock block = stream.block(i);
    for (const std::uint32_t word : block) words.add(word);
    for (const float deviate : normal_deviates(block)) deviates.add(deviate);
  }
  EXPECT_EQ(words.value(), 0x3860ecc6e268322bU) << std::hex << words.value();
  EXPECT_EQ(deviates.value(), 0x3680894d058fe255U) << std::hex << deviates.value();
}

// Filters of noise whose rise is unlimited and limited: with real poles alone, and with a pair of
// complex ones.
TEST(NoiseShape, HasTheRecordedBits) {
  Hash hash;
  for (const double rise_limit_hz : {0.0, 0.5}) {
    for (std::uint32_t i = 0; i < 20; ++i) {
      const NoiseShape shape = shape_noise({.white_asd = 1e-12,
                                            .pink_corner_hz = 1e-3 * (1.0 + i),
                                            .rise_asd = 2e-12,
                                            .rise_corner_hz = 0.03 + 0.001 * i,
                                            .rise_limit_hz = rise_limit_hz},
                                           0.25);
      hash.add(shape.gain);
      hash.add(shape.pole);
      hash.add(shape.coefficient);
      hash.add(shape.pair_pole);
      hash.add(shape.pair_coefficient);
      hash.add(shape.start_factor);
      hash.add(shape.psd(1e-2, 0.25));
    }
  }
  EXPECT_EQ(hash.value(), 0x4244e25269950a29U) << std::hex << hash.value();
}

TEST(ReferenceDigest, HasTheRecordedBits) {
  const std::uint64_t digest = reference_digest(best_instruction_set());
  EXPECT_EQ(digest, 0x1e9ea6c3c506bd0dU) << std::hex << " 0x" << digest;
}

// Without a range that ends it, the run grows beyond all numbers.
TEST(LostRun, HasTheRecordedBits) {
  MicroscopeCampaign campaign;
  campaign.scenario.simulation.sample_period_s = 1.0;
  campaign.scenario.simulation.settling_s = 100.0;
  campaign.scenario.sensor.range_m_s2 = 1e300;
  for (Session& session : campaign.scenario.sessions) session.num_orbits = 1;
  test::law_of(campaign, "thruster_scale_error.x").law = Law::table;
  campaign.num_runs = 1;
  campaign.table_columns = {{50.0}};
  const std::vector<RunRequest> requests{{RunIndex{0}, campaign.table_values(RunIndex{0})}};
  const RunPlan plan(campaign);
  for (const InstructionSet set : {InstructionSet::scalar, best_instruction_set()}) {
    const RunResult result = plan.simulate_batch(requests, set)[0];
    EXPECT_EQ(result.status, RunStatus::lost) << name_of(set);
    Hash hash;
    hash.add(result.loss.cause);
    hash.add(result.loss.session);
    hash.add(result.health);
    EXPECT_EQ(hash.value(), 0x96a9e2e9d4ce8466U)
        << name_of(set) << std::hex << " 0x" << hash.value();
  }
}

/// Hash of the estimates of run 0 in a campaign whose sessions are cut to one orbit at a sample a
/// second after a short settling, with so many runs beside it: emulated processors take minutes for
/// more.
std::uint64_t hash_of_run(InstructionSet set, std::size_t num_runs) {
  MicroscopeCampaign campaign;
  campaign.seed = 20131121;
  campaign.scenario.simulation.sample_period_s = 1.0;
  campaign.scenario.simulation.settling_s = 100.0;
  for (Session& session : campaign.scenario.sessions) session.num_orbits = 1;
  Hash hash;
  hash.add(RunPlan(campaign).simulate_batch(test::requests_from(0, num_runs), set)[0].estimate);
  return hash.value();
}

constexpr std::uint64_t hash_of_run_0 = 0x1bd4246584ff591c;

TEST(Run, HasTheRecordedBits) {
  const std::uint64_t hash = hash_of_run(InstructionSet::scalar, 1);
  EXPECT_EQ(hash, hash_of_run_0) << std::hex << " 0x" << hash;
}

TEST(Batch, HasTheRecordedBits) {
  for (const InstructionSet set : available_instruction_sets()) {
    if (set == InstructionSet::scalar) continue;
    for (const std::size_t num_runs : {std::size_t{1}, batch_lanes / 2 + 1}) {
      const std::uint64_t hash = hash_of_run(set, num_runs);
      EXPECT_EQ(hash, hash_of_run_0)
          << name_of(set) << " " << num_runs << std::hex << " 0x" << hash;
    }
  }
}

}  // namespace
}  // namespace proofmass
