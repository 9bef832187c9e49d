// A batch must give each of its runs the bits that the scalar reference gives it.

#include <fmt/format.h>

#include <regex>

#include "core/campaign/device.hpp"
#include "core/microscope/simulation/gpu/device_simulation.hpp"
#include "core/microscope/simulation/reference_digest.hpp"
#include "core/microscope/simulation/run.hpp"
#include "tests/support/cuda_driver/test_device.hpp"
#include "tests/support/runs.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

using test::bits_of;
using test::requests_from;

/// All sessions cut to one orbit of few samples after a short settling: every line of the kernel in
/// a fraction of the time.
MicroscopeCampaign short_campaign() {
  MicroscopeCampaign campaign;
  campaign.seed = 20131121;
  campaign.scenario.simulation.sample_period_s = 1.0;
  campaign.scenario.simulation.settling_s = 100.0;
  for (Session& session : campaign.scenario.sessions) session.num_orbits = 1;
  return campaign;
}

/// The requests again and again, until no narrow kernel has room for them.
std::vector<RunRequest> filled(const std::vector<RunRequest>& requests) {
  std::vector<RunRequest> full;
  for (std::size_t i = 0; i < batch_lanes; ++i) full.push_back(requests[i % requests.size()]);
  return full;
}

std::vector<RunRequest> first_of(const std::vector<RunRequest>& requests, std::size_t count) {
  return {requests.begin(), requests.begin() + static_cast<std::ptrdiff_t>(count)};
}

std::vector<RunResult> on_device(const RunPlan& plan, std::span<const RunRequest> requests) {
  const std::unique_ptr<DeviceSimulation> simulation = plan.simulation_on(test::device());
  simulation->add(7, requests);
  while (true) {
    std::vector<DeviceSimulation::Ended> ended = simulation->advance();
    if (!ended.empty()) return std::move(ended.front().results);
  }
}

/// Whether devices simulate a campaign, or leave it to processors.
enum class OnDevices : std::uint8_t { simulated, left_out };

/// Compares every run of a batch on every instruction set with the same run alone: in that batch,
/// in a full one, and in those of one and two runs, whose sessions are computed side by side; and
/// the runs on a device.
void expect_batch_equals_scalar(const MicroscopeCampaign& campaign,
                                const std::vector<RunRequest>& requests,
                                OnDevices on_devices = OnDevices::simulated) {
  campaign.validate();
  const RunPlan plan(campaign);
  std::vector<RunResult> alone;
  for (const RunRequest& request : requests) {
    alone.push_back(plan.simulate(request.run, request.table_values));
  }
  for (const InstructionSet set : available_instruction_sets()) {
    if (set == InstructionSet::scalar) continue;
    for (const std::vector<RunRequest>& batch :
         {requests, filled(requests), first_of(requests, 1), first_of(requests, 2)}) {
      const std::vector<RunResult> results = plan.simulate_batch(batch, set);
      ASSERT_EQ(results.size(), batch.size());
      for (std::size_t i = 0; i < results.size(); ++i) {
        EXPECT_EQ(bits_of(results[i]), bits_of(alone[i % alone.size()]))
            << fmt::format("{} lane {} of {}", name_of(set), i, results.size());
      }
    }
  }
  EXPECT_EQ(plan.runs_on_devices(), on_devices == OnDevices::simulated);
  if (!plan.runs_on_devices()) return;
  const std::vector<RunResult> results = on_device(plan, requests);
  ASSERT_EQ(results.size(), alone.size());
  for (std::size_t i = 0; i < results.size(); ++i) {
    EXPECT_EQ(bits_of(results[i]), bits_of(alone[i])) << fmt::format("device, lane {}", i);
  }
}

TEST(Batch, EqualsTheScalarReferenceForAnyNumberOfRuns) {
  const RunPlan plan(short_campaign());
  std::vector<RunResult> alone;
  for (const RunRequest& request : requests_from(100, batch_lanes)) {
    alone.push_back(plan.simulate(request.run, {}));
  }
  for (const InstructionSet set : available_instruction_sets()) {
    if (set == InstructionSet::scalar) continue;
    for (const std::size_t count : {1U, 2U, 3U, 4U, 5U, 7U, 8U, 9U, 15U, 16U}) {
      const std::vector<RunResult> batch = plan.simulate_batch(requests_from(100, count), set);
      ASSERT_EQ(batch.size(), count);
      for (std::size_t i = 0; i < count; ++i) {
        EXPECT_EQ(bits_of(batch[i]), bits_of(alone[i]))
            << fmt::format("{} {} of {}", name_of(set), i, count);
      }
    }
  }
}

/// What is special about a campaign; its first runs are computed.
struct Special {
  std::string name;
  std::function<void(MicroscopeCampaign&)> make;
  OnDevices on_devices = OnDevices::simulated;
  std::size_t num_runs = 3;
};

/// Sessions begin and end at different times, and no record is a multiple of four samples long:
/// lanes that wait for the next session go on idle.
void vary_lengths(MicroscopeCampaign& campaign) {
  campaign.scenario.orbit.period_s = 5901.3;
  for (std::size_t i = 0; i < campaign.scenario.sessions.size(); ++i) {
    campaign.scenario.sessions[i].num_orbits = 1 + static_cast<int>(i * i % 4);
  }
}

void use_one_sensor(MicroscopeCampaign& campaign) {
  campaign.scenario.sensor.position_m = {0.01, 0.17, -0.02};
  for (std::size_t i = 0; i < 9; ++i) {
    campaign.scenario.sessions[i].drag_free = DragFreeSource::sensor_2;
  }
}

void stiffen(MicroscopeCampaign& campaign) {
  campaign.scenario.sensor.position_m = {0.01, 0.17, -0.02};
  campaign.scenario.sensor.radial_stiffness_s2 = {-0.05, 0.0};
}

void shake_more(MicroscopeCampaign& campaign) {
  std::vector<Excitation>& excitations = campaign.scenario.sessions[6].excitations;
  excitations.push_back({ExcitationKind::test_mass, Axis::z, 1e-6, 9.88e-3});
  excitations.push_back({ExcitationKind::attitude, Axis::y, 1e-4, 7e-4});
  excitations.push_back({ExcitationKind::drag_free, Axis::y, 1e-8, 2.9e-3});
}

void use_environment_table(MicroscopeCampaign& campaign) {
  campaign.scenario.environment.kind = EnvironmentKind::file;
  campaign.environment_file = "table.csv";
  campaign.environment_table = {{.time_s = 0.0, .linear_m_s2 = {1e-9, 0.0, 0.0}},
                                {.time_s = 3000.0, .linear_m_s2 = {-1e-8, 3e-9, 0.0}},
                                {.time_s = 5950.0, .linear_m_s2 = {1e-9, 0.0, 0.0}}};
}

std::vector<Special> special_campaigns() {
  using Campaign = MicroscopeCampaign;
  constexpr auto left_out = OnDevices::left_out;
  const auto of_preset = [](NoisePreset preset) {
    return [=](Campaign& c) { c.scenario.noise = noise_preset(preset); };
  };
  const auto with_factors = [](std::array<double, 2> factors) {
    return [=](Campaign& c) { c.scenario.noise.linear_factor = factors; };
  };
  return {
      {"SessionsOfDifferentLengths", vary_lengths, OnDevices::simulated, 4},
      {"LoopsThatDoNotSettle", [](Campaign& c) { c.scenario.simulation.settling_s = 0.0; }},
      // Then sessions are not computed side by side.
      {"AnOddNumberOfSettling", [](Campaign& c) { c.scenario.simulation.settling_s = 101.0; }},
      {"ComplexPolesInTheNoise", of_preset(NoisePreset::flight_suref)},
      {"Wires", of_preset(NoisePreset::wire_suep), left_out},
      {"NoiseOfEachSensor", with_factors({1.0, 2.0}), left_out},
      {"MoreNoiseOfBothSensors", with_factors({2.0, 2.0})},
      {"NoNoise", [](Campaign& c) { c.scenario.noise.scale = 0.0; }},
      {"Stiffness", stiffen, left_out},
      {"OneSensorAwayFromTheCentreOfMass", use_one_sensor},
      {"ARotatingFrame", [](Campaign& c) { c.scenario.sessions[3].spin_rate_rad_s = 4.7e-3; }},
      {"SeveralExcitations", shake_more},
      // Here the orbit is computed time by time.
      {"AnEccentricOrbit", [](Campaign& c) { c.scenario.orbit.eccentricity = 0.1; }},
      {"AnEnvironmentTable", use_environment_table},
  };
}

class BatchOf : public testing::TestWithParam<Special> {};

TEST_P(BatchOf, EqualsTheScalarReference) {
  MicroscopeCampaign campaign = short_campaign();
  GetParam().make(campaign);
  expect_batch_equals_scalar(campaign, requests_from(0, GetParam().num_runs),
                             GetParam().on_devices);
}

INSTANTIATE_TEST_SUITE_P(ACampaignWith, BatchOf, testing::ValuesIn(special_campaigns()),
                         [](const auto& tested) { return tested.param.name; });

TEST(Batch, TakesRunsFromAnywhereInAnyOrder) {
  // Run numbers past 2³² reach the upper counter word.
  expect_batch_equals_scalar(
      short_campaign(),
      {{RunIndex{900'000'000}, {}}, {RunIndex{3}, {}}, {RunIndex{(1ULL << 40) + 3}, {}}});
}

void expect_carries_a_bad_run(double range_m_s2) {
  MicroscopeCampaign campaign = short_campaign();
  campaign.scenario.sensor.range_m_s2 = range_m_s2;
  test::law_of(campaign, "thruster_scale_error.x").law = Law::table;
  campaign.num_runs = 3;
  campaign.table_columns = {{0.0, 50.0, 0.0}};  // A loop gain fifty times too high.
  std::vector<RunRequest> requests;
  for (std::uint64_t run = 0; run < 3; ++run) {
    requests.push_back({RunIndex{run}, campaign.table_values(RunIndex{run})});
  }
  const RunPlan plan(campaign);
  std::vector<RunResult> alone;
  for (const RunRequest& request : requests) {
    alone.push_back(plan.simulate(request.run, request.table_values));
  }
  for (const InstructionSet set : available_instruction_sets()) {
    if (set == InstructionSet::scalar) continue;
    for (const std::vector<RunRequest>& batch : {requests, filled(requests)}) {
      const std::vector<RunResult> results = plan.simulate_batch(batch, set);
      EXPECT_EQ(results[1].status, RunStatus::lost) << name_of(set);
      for (const std::size_t i : {0U, 1U, 2U}) {
        EXPECT_EQ(bits_of(results[i]), bits_of(alone[i])) << std::string(name_of(set));
      }
    }
  }
  const std::vector<RunResult> results = on_device(plan, requests);
  EXPECT_EQ(results[1].status, RunStatus::lost);
  for (const std::size_t i : {0U, 1U, 2U})
    EXPECT_EQ(bits_of(results[i]), bits_of(alone[i])) << "device";
}

// Without a range that ends it, the run grows beyond all numbers.
TEST(Batch, CarriesARunThatDivergesBesideOnesThatDoNot) { expect_carries_a_bad_run(1e300); }

TEST(Batch, CarriesARunThatSaturatesBesideOnesThatDoNot) { expect_carries_a_bad_run(1e-5); }

TEST(Batch, SaysWhichRunsHaveNoDraw) {
  MicroscopeCampaign campaign = short_campaign();
  campaign.scenario.acceptance.a_d11_max = 1e-300;
  const RunPlan plan(campaign);
  for (const InstructionSet set : available_instruction_sets()) {
    for (const RunResult& result : plan.simulate_batch(requests_from(0, 2), set)) {
      EXPECT_EQ(result.status, RunStatus::no_draw) << name_of(set);
    }
  }
  for (const RunResult& result : on_device(plan, requests_from(0, 2))) {
    EXPECT_EQ(result.status, RunStatus::no_draw);
  }
}

// More sessions than the card has blocks: some wait, and slots are used again.
TEST(Device, EqualsTheScalarReferenceForSeveralGroups) {
  const RunPlan plan(short_campaign());
  const std::unique_ptr<DeviceSimulation> simulation = plan.simulation_on(test::device());
  for (std::uint64_t group = 0; group < 3; ++group) {
    simulation->add(group, requests_from(10 * group, 1 + group));
  }
  EXPECT_EQ(simulation->num_in_flight(), 6U);
  std::size_t num_ended = 0;
  while (simulation->num_in_flight() > 0) {
    for (const DeviceSimulation::Ended& ended : simulation->advance()) {
      ASSERT_EQ(ended.results.size(), 1 + ended.group);
      for (const RunResult& result : ended.results) {
        EXPECT_EQ(bits_of(result), bits_of(plan.simulate(result.run, {})))
            << fmt::format("group {}", ended.group);
      }
      ++num_ended;
    }
    if (num_ended == 0) {
      EXPECT_LE(simulation->num_steps_done(2), plan.num_steps());
    }
  }
  EXPECT_EQ(num_ended, 3U);
}

TEST(Device, ProvesTheReferenceDigest) {
  const auto proof = prove_device(test::device());
  ASSERT_TRUE(proof.has_value());
  EXPECT_EQ(proof->digest, reference_digest(InstructionSet::scalar));
  EXPECT_GE(proof->capacity, 1U);
}

// A driver compiles what is written here, and nothing else may round.
TEST(Device, HasAProgramThatRoundsAsProcessorsDo) {
  const std::string program(gpu::program());
  ASSERT_FALSE(program.empty()) << "built without clang, which deploy/install-deps.sh installs";
  for (const std::string_view other : {"fma.", "mad.f", "mad.rn", ".approx", ".ftz", ".full",
                                       "call", "__local_depot", "ld.local", "st.local"}) {
    EXPECT_EQ(program.find(other), std::string::npos) << other;
  }
  const std::regex rounded("\\b(add|sub|mul|div|sqrt)\\.(\\w+\\.)?f(32|64)");
  for (std::sregex_iterator found(program.begin(), program.end(), rounded), end; found != end;
       ++found) {
    ASSERT_EQ(found->str(2), "rn.") << found->str();
  }
}

TEST(Batch, ReportsItsOrbits) {
  const RunPlan plan(short_campaign());
  for (const InstructionSet set : available_instruction_sets()) {
    const std::size_t largest = set == InstructionSet::scalar ? 3 : batch_lanes;
    for (const std::size_t count : {std::size_t{1}, std::size_t{2}, largest}) {
      int last = 0;
      (void)plan.simulate_batch(requests_from(0, count), set, [&last](int orbits) {
        EXPECT_GE(orbits, last);
        last = orbits;
      });
      EXPECT_EQ(last, plan.num_steps()) << name_of(set) << ", " << count;
    }
  }
}

}  // namespace
}  // namespace proofmass
