#include "tests/benchmarks/bench/bench_parts.hpp"

#include <algorithm>
#include <bit>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <tuple>
#include <vector>

#include "core/microscope/campaign/microscope_campaign.hpp"
#include "core/microscope/control/control_loops.hpp"
#include "core/microscope/environment/environment.hpp"
#include "core/microscope/instrument/instrument.hpp"
#include "core/microscope/orbit/kepler_orbit.hpp"
#include "core/microscope/simulation/batch_kernel.hpp"
#include "core/microscope/simulation/session_record.hpp"
#include "core/random/normal.hpp"
#include "core/signal/line_weights.hpp"

namespace proofmass::test {
namespace {

/// Makes the compiler believe that somebody reads the value.
template <typename T>
void keep(const T& value) {
  asm volatile("" : : "g"(&value) : "memory");
}

/// Nanoseconds of one call, over some tenths of a second.
template <typename Work>
double ns_per_call(const Work& work) {
  using Clock = std::chrono::steady_clock;
  constexpr std::size_t calls_at_a_time = 1000;
  const auto start = Clock::now();
  std::chrono::duration<double> elapsed{};
  std::size_t num_calls = 0;
  while (elapsed < std::chrono::milliseconds(300)) {
    for (std::size_t i = 0; i < calls_at_a_time; ++i) work();
    num_calls += calls_at_a_time;
    elapsed = Clock::now() - start;
  }
  return 1e9 * elapsed.count() / static_cast<double>(num_calls);
}

double scalar_deviate_ns() {
  std::uint32_t counter = 0;
  return ns_per_call([&] { keep(normal_deviates(philox({counter++, 1, 2, 3}, 4))); }) / 4.0;
}

/// A session, its shared signals and a drawn satellite.
struct Bench {
  explicit Bench(const MicroscopeCampaign& of)
      : campaign(of),
        session(of.scenario.sessions.front()),
        orbit(of.scenario.orbit),
        environment(of.scenario.environment, of.environment_table, of.scenario.orbit.period_s),
        signals(of.scenario, session, orbit, environment),
        constants(make_loop_constants(
            make_instrument(draw_values(of.dispersions, of.seed, RunIndex{0}, 0, {})), of.scenario,
            session)),
        drag_free(drag_free_gains(of.scenario.drag_free, of.scenario.simulation.sample_period_s)),
        attitude(attitude_gains(of.scenario.attitude, of.scenario.simulation.sample_period_s)) {
    loop.begin(signals.reference_at_start());
  }

  Observation<double> advance(const SharedSample& shared) {
    return loop.advance(constants, drag_free, attitude, shared, SampleNoise<double>{});
  }

  const MicroscopeCampaign& campaign;
  const Session& session;
  KeplerOrbit orbit;
  Environment environment;
  SessionSignals signals;
  LoopConstants<double> constants;
  DragFreeGains drag_free;
  AttitudeGains attitude;
  Loop<double> loop;
};

/// Ground signals and their sums, with weights at hand.
double sums_ns(Bench& bench) {
  const SharedSample shared = bench.signals.next();
  const Observation<double> observation = bench.advance(shared);
  const TargetInfo& target = target_info(bench.session.target);
  const std::array<double, 2> weights{0.5, -0.5};
  SignalSums<double> sums{};
  return ns_per_call([&] {
    keep(observation);
    add_sample(ground_signals(observation, shared, target.product), weights.data(), weights.size(),
               target.product, target.signals, sums);
    keep(sums);
  });
}

/// Weights of a record with one fitted line and one known line.
double weights_ns(const Bench& bench) {
  const double period_s = bench.campaign.scenario.simulation.sample_period_s;
  constexpr double line_hz = 1e-2;
  const LineWeights weights({.num_samples = 10 * LineWeights::block_size,
                             .num_dropped = LineWeights::block_size,
                             .sample_period_s = period_s,
                             .filter = band_pass(line_hz / 3.0, line_hz * 3.0, period_s),
                             .fit_hz = {line_hz},
                             .known_hz = {1.5 * line_hz}});
  WeightReader reader(weights);
  std::vector<double> block(2 * LineWeights::block_size);
  const double block_ns = ns_per_call([&] {
    reader.fill_block(1, block);
    keep(block);
  });
  return block_ns / static_cast<double>(LineWeights::block_size);
}

NoiseCost scalar_noise(const MicroscopeCampaign& campaign, const NoiseModel& model) {
  SessionNoise noise(model, campaign.seed, RunIndex{0}, campaign.scenario.sessions.front().name);
  return {.deviate_ns = scalar_deviate_ns(), .step_ns = ns_per_call([&] { keep(noise.next()); })};
}

/// Of one run of a full batch.
NoiseCost batch_noise(const MicroscopeCampaign& campaign, const NoiseModel& model,
                      InstructionSet set) {
  const std::string& session_name = campaign.scenario.sessions.front().name;
  const NoiseStreams streams = noise_streams(session_name);
  BatchSession batch;
  batch.noise = &model;
  batch.streams = &streams;
  batch.seed = campaign.seed;
  for (std::size_t lane = 0; lane < batch_lanes; ++lane) {
    batch.runs[lane] = RunIndex{lane};
    batch.noise_states[lane] =
        stationary_states(model, campaign.seed, batch.runs[lane], session_name);
  }
  constexpr std::size_t num_samples = 64;
  const auto lane_sample_ns = [&](NoiseWork work) {
    const BatchNoiseKernel kernel = batch_noise_kernel(set);
    const double ns = ns_per_call([&] { keep(kernel(batch, num_samples, work)); });
    return ns / static_cast<double>(num_samples * batch_lanes);
  };
  return {.deviate_ns = lane_sample_ns(NoiseWork::deviates) / num_noise_channels,
          .step_ns = lane_sample_ns(NoiseWork::shaped)};
}

}  // namespace

NoiseCost measure_noise(const MicroscopeCampaign& campaign, InstructionSet set) {
  const Scenario& scenario = campaign.scenario;
  const NoiseModel model = make_noise_model(scenario.noise, scenario.simulation.sample_period_s);
  if (set == InstructionSet::scalar) return scalar_noise(campaign, model);
  return batch_noise(campaign, model, set);
}

StepCost measure_step_parts(const MicroscopeCampaign& campaign) {
  Bench bench(campaign);
  StepCost step;
  step.shared_signals_ns = ns_per_call([&] { keep(bench.signals.next()); });
  const SharedSample shared = bench.signals.next();
  step.dynamics_ns = ns_per_call([&] { keep(bench.advance(shared)); });
  step.estimation_ns = sums_ns(bench) + weights_ns(bench);
  return step;
}

bool agree_to_the_bit(const RunResult& a, const RunResult& b) {
  const auto agree = [](const std::vector<double>& left, const std::vector<double>& right) {
    return std::ranges::equal(left, right, {}, std::bit_cast<std::uint64_t, double>,
                              std::bit_cast<std::uint64_t, double>);
  };
  return std::tie(a.run, a.status, a.num_draws, a.num_rounds) ==
             std::tie(b.run, b.status, b.num_draws, b.num_rounds) &&
         agree(a.truth, b.truth) && agree(a.estimate, b.estimate);
}

bool agree_with_known(std::span<const RunResult> results, std::vector<RunResult>& known) {
  bool is_same = true;
  for (std::size_t i = 0; i < results.size(); ++i) {
    if (i == known.size()) known.push_back(results[i]);
    is_same = is_same && agree_to_the_bit(results[i], known[i]);
  }
  return is_same;
}

}  // namespace proofmass::test
