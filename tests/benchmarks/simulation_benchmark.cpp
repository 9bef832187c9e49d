// Speed of a run and of its parts. Machines are noisy: compare numbers of one execution only.
//
// `steps/s` counts simulated samples of one run; the parts are what one step is made of.

#include <benchmark/benchmark.h>

#include <cstdint>
#include <string>
#include <vector>

#include "core/math/instruction_set.hpp"
#include "core/microscope/campaign/microscope_campaign.hpp"
#include "core/microscope/control/control_loops.hpp"
#include "core/microscope/environment/environment.hpp"
#include "core/microscope/instrument/instrument.hpp"
#include "core/microscope/orbit/kepler_orbit.hpp"
#include "core/microscope/simulation/run.hpp"
#include "core/microscope/simulation/session_record.hpp"
#include "core/model.hpp"
#include "core/random/normal_deviates.hpp"
#include "core/signal/line_weights.hpp"
#include "tests/support/microscope_results.hpp"

namespace proofmass {
namespace {

double num_steps(const MicroscopeCampaign& campaign) {
  const double period_s = campaign.scenario.simulation.sample_period_s;
  double steps = 0.0;
  for (const Session& session : campaign.scenario.sessions) {
    steps += session.num_orbits * campaign.scenario.orbit.period_s / period_s;
    steps += campaign.scenario.simulation.settling_s / period_s;
  }
  return steps;
}

void count_steps(benchmark::State& state, double steps_per_iteration) {
  state.counters["steps/s"] =
      benchmark::Counter(steps_per_iteration, benchmark::Counter::kIsIterationInvariantRate);
}

void whole_run(benchmark::State& state) {
  const MicroscopeCampaign campaign;
  const RunPlan plan(campaign);
  std::uint64_t run = 0;
  for (auto _ : state) benchmark::DoNotOptimize(plan.simulate(RunIndex{run++}, {}));
  count_steps(state, num_steps(campaign));
}
BENCHMARK(whole_run)->Unit(benchmark::kMillisecond);

/// Batches of one run and of as many as there are lanes, with an instruction set of this machine.
void runs_of_a_batch(benchmark::State& state, InstructionSet set) {
  const MicroscopeCampaign campaign;
  const RunPlan plan(campaign);
  std::vector<RunRequest> requests;
  for (std::int64_t run = 0; run < state.range(0); ++run) {
    requests.push_back({.run = {static_cast<std::uint64_t>(run)}, .table_values = {}});
  }
  for (auto _ : state) benchmark::DoNotOptimize(plan.simulate_batch(requests, set));
  count_steps(state, num_steps(campaign) * static_cast<double>(state.range(0)));
}

/// A whole batch of one session of ten orbits: the parts of a run and, with and without gaps, of a
/// test.
void session_of_a_batch(benchmark::State& state, const Session& session, const GapsConfig& gaps) {
  MicroscopeCampaign campaign;
  campaign.scenario.sessions = {session};
  campaign.scenario.sessions[0].num_orbits = 10;
  campaign.scenario.gaps = gaps;
  EstimationMethodInfo method = estimation_methods()[0];
  method.estimate = [](const RunPhasors&, const EstimationInput&) { return Estimation{}; };
  const RunPlan plan(campaign, method);
  std::vector<RunRequest> requests(batch_lanes);
  for (std::uint64_t run = 0; run < batch_lanes; ++run) requests[run].run = {run};
  for (auto _ : state) {
    for (const RunRecord& record : plan.record_batch(requests, best_instruction_set())) {
      benchmark::DoNotOptimize(is_test(session) ? plan.estimate(record).status
                                                : RunStatus::completed);
    }
  }
  count_steps(state, num_steps(campaign) * static_cast<double>(batch_lanes));
}

[[maybe_unused]] const bool are_sessions_registered = [] {
  const auto add = [](const std::string& name, const Session& session, const GapsConfig& gaps) {
    benchmark::RegisterBenchmark(("session_of_a_batch/" + name).c_str(), session_of_a_batch,
                                 session, gaps)
        ->Unit(benchmark::kMillisecond);
  };
  for (const Session& session : hardy2013_sessions()) add(session.name, session, {});
  Session test;
  test.name = "ep_test";
  test.target = SessionTarget::ep_test;
  add(test.name, test, {});
  GapsConfig gaps;
  gaps.glitch_rate_hz = 0.02;
  add(test.name + "_with_gaps", test, gaps);
  return true;
}();

[[maybe_unused]] const bool are_batches_registered = [] {
  for (const InstructionSet set : available_instruction_sets()) {
    if (set == InstructionSet::scalar) continue;
    benchmark::RegisterBenchmark(("runs_of_a_batch/" + std::string(name_of(set))).c_str(),
                                 runs_of_a_batch, set)
        ->Arg(1)
        ->Arg(batch_lanes)
        ->Unit(benchmark::kMillisecond);
  }
  return true;
}();

void reference_digest_of_the_model(benchmark::State& state) {
  for (auto _ : state) {
    benchmark::DoNotOptimize(model().reference_digest(best_instruction_set()));
  }
}
BENCHMARK(reference_digest_of_the_model)->Unit(benchmark::kMillisecond);

void plan_of_a_campaign(benchmark::State& state) {
  const MicroscopeCampaign campaign;
  for (auto _ : state) benchmark::DoNotOptimize(RunPlan(campaign).num_steps());
}
BENCHMARK(plan_of_a_campaign)->Unit(benchmark::kMillisecond);

void normal_deviate(benchmark::State& state) {
  std::uint32_t counter = 0;
  for (auto _ : state) benchmark::DoNotOptimize(normal_deviates(philox({counter++, 1, 2, 3}, 4)));
  state.counters["deviates/s"] =
      benchmark::Counter(4.0, benchmark::Counter::kIsIterationInvariantRate);
}
BENCHMARK(normal_deviate);

void noise_of_a_step(benchmark::State& state) {
  const Scenario scenario;
  const NoiseModel model = make_noise_model(scenario.noise, scenario.simulation.sample_period_s);
  SessionNoise noise(model, 1, RunIndex{0}, "benchmark");
  for (auto _ : state) benchmark::DoNotOptimize(noise.next());
  count_steps(state, 1.0);
}
BENCHMARK(noise_of_a_step);

/// A session, its shared signals and a drawn satellite.
struct Bench {
  MicroscopeCampaign campaign;
  const Session& session = campaign.scenario.sessions[index(SessionTarget::a_c13)];
  KeplerOrbit orbit{campaign.scenario.orbit};
  Environment environment{campaign.scenario.environment, campaign.environment_table,
                          campaign.scenario.orbit.period_s};
  SessionSignals signals{campaign.scenario, session, orbit, environment};
  LoopConstants<double> constants =
      make_loop_constants(make_instrument(draw_values(campaign.dispersions, 1, RunIndex{0}, 0, {})),
                          campaign.scenario, session);
  DragFreeGains drag_free = drag_free_gains(campaign.scenario.drag_free, 0.25);
  AttitudeGains attitude = attitude_gains(campaign.scenario.attitude, 0.25);
};

void shared_signals_of_a_step(benchmark::State& state) {
  Bench bench;
  for (auto _ : state) benchmark::DoNotOptimize(bench.signals.next());
  count_steps(state, 1.0);
}
BENCHMARK(shared_signals_of_a_step);

void dynamics_of_a_step(benchmark::State& state) {
  Bench bench;
  const SharedSample shared = bench.signals.next();
  const SampleNoise<double> no_noise{};
  Loop<double> loop;
  loop.begin(bench.signals.reference_at_start());
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        loop.advance(bench.constants, bench.drag_free, bench.attitude, shared, no_noise));
  }
  count_steps(state, 1.0);
}
BENCHMARK(dynamics_of_a_step);

void ground_signals_of_a_step(benchmark::State& state) {
  Bench bench;
  const SharedSample shared = bench.signals.next();
  Loop<double> loop;
  loop.begin(bench.signals.reference_at_start());
  Observation<double> observation =
      loop.advance(bench.constants, bench.drag_free, bench.attitude, shared, {});
  for (auto _ : state) {
    benchmark::DoNotOptimize(observation);
    benchmark::DoNotOptimize(ground_signals(observation, shared, Product::modulated_zz));
  }
  count_steps(state, 1.0);
}
BENCHMARK(ground_signals_of_a_step);

void line_weights_of_a_step(benchmark::State& state) {
  LineFit fit;
  fit.num_samples = 238000;
  fit.num_dropped = 4000;
  fit.filter = band_pass(9.88e-3 / 3, 9.88e-3 * 3, 0.25);
  fit.fit_hz = {9.88e-3 + 2.0 / 5950, 9.88e-3 - 2.0 / 5950};
  fit.known_hz = {9.88e-3, 1.0 / 5950, 2.0 / 5950, 9.88e-3 + 1.0 / 5950, 9.88e-3 - 1.0 / 5950};
  const LineWeights weights(fit);
  WeightReader reader(weights);
  std::vector<double> block(LineWeights::block_size * 4);
  for (auto _ : state) {
    reader.fill_block(7, block);
    benchmark::DoNotOptimize(block.data());
  }
  count_steps(state, static_cast<double>(LineWeights::block_size));
}
BENCHMARK(line_weights_of_a_step);

}  // namespace
}  // namespace proofmass
