#include "core/microscope/simulation/run.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <functional>
#include <memory>
#include <numeric>
#include <optional>
#include <vector>

#include "core/error.hpp"
#include "core/microscope/campaign/microscope_campaign.hpp"
#include "core/microscope/estimation/ep_test/ep_test.hpp"
#include "core/microscope/estimation/methods.hpp"
#include "core/microscope/simulation/batch_kernel.hpp"
#include "core/microscope/simulation/gpu/device_simulation.hpp"
#include "core/microscope/simulation/realism.hpp"
#include "core/microscope/simulation/recorded_signals.hpp"
#include "core/microscope/simulation/run_health.hpp"
#include "core/microscope/simulation/run_parts.hpp"
#include "core/microscope/simulation/session_record.hpp"

namespace proofmass {
namespace {

/// Turns the samples done in a session into the orbits done in the run.
class SessionProgress {
 public:
  SessionProgress(const Scenario& scenario, const std::function<void(int)>& report)
      : scenario_(scenario), report_(report) {}

  void operator()(std::size_t num_samples) const {
    if (!report_) return;
    const double elapsed_s =
        static_cast<double>(num_samples) * scenario_.simulation.sample_period_s;
    report_(orbits_before_ + static_cast<int>(elapsed_s / scenario_.orbit.period_s));
  }
  static void report_to(const void* progress, std::size_t num_samples) {
    (*static_cast<const SessionProgress*>(progress))(num_samples);
  }
  void end_session(std::size_t i) { orbits_before_ += scenario_.sessions[i].num_orbits; }

 private:
  const Scenario& scenario_;
  const std::function<void(int)>& report_;
  int orbits_before_ = 0;
};

/// A run of a batch.
struct Lane {
  RunIndex run;
  Instrument instrument;
  std::size_t index = 0;  ///< Of its record.
};

bool are_in_range(std::span<const double> values) {
  return std::ranges::all_of(values, is_in_range);
}

/// Correlations (0, 1), (0, 2) ... of quantities of which `covariance(i, j)` is known.
template <typename Correlation>
std::vector<double> pairs(std::size_t num_quantities, const Correlation& correlation) {
  std::vector<double> all;
  for (std::size_t i = 0; i < num_quantities; ++i) {
    for (std::size_t j = i + 1; j < num_quantities; ++j) {
      // To a millionth: a database keeps them as text.
      all.push_back(std::round(1e6 * correlation(i, j)) / 1e6 + 0.0);
    }
  }
  return all;
}

}  // namespace

std::vector<double> run_truth(const Scenario& scenario, const ParameterArray& truth,
                              double eotvos_parameter) {
  std::vector<double> values(truth.begin(), truth.end());
  if (!scenario.has_tests()) return values;
  values.push_back(eotvos_parameter);
  for (const Parameter delta : {Parameter::a_c11_delta_x, Parameter::a_c11_delta_z}) {
    values.push_back(truth[index(delta)]);
  }
  values.push_back(eotvos_parameter);
  return values;
}

struct RunPlan::Impl : RunParts {
  using RunParts::RunParts;

  /// @param observer  Empty if nobody observes the run.
  void record_session_of_run(std::size_t i, const Instrument& instrument,
                             const SampleObserver& observer, const SessionProgress& progress,
                             RunRecord& record) const {
    const Scenario& scenario = campaign.scenario;
    const Session& session = scenario.sessions[i];
    SessionSignals signals(scenario, session, orbit, environment);
    const LoopConstants<double> constants = make_loop_constants(instrument, scenario, session);
    SessionNoise session_noise(noise, campaign.seed, record.run, session.name);
    Realism realism(scenario, instrument, constants, i, signals.num_settling());
    if (!observer) {
      LaneGroup<double, SessionNoise, Realism> alone{.constants = constants,
                                                     .noise = session_noise};
      alone.eotvos_parameter = instrument.eotvos_parameter;
      alone.hardware = std::move(realism);
      record_session_alone(i, signals, alone, NoObserver{}, progress, record);
      return;
    }
    LaneGroup<double, ObservedNoise, Realism> alone{
        .constants = constants, .noise = ObservedNoise(std::move(session_noise))};
    alone.eotvos_parameter = instrument.eotvos_parameter;
    alone.hardware = std::move(realism);
    const double period_s = scenario.simulation.sample_period_s;
    const SessionObserver session_observer{.observe = observer,
                                           .session = i,
                                           .next = -signals.num_settling(),
                                           .sample_period_s = period_s,
                                           .constants = alone.constants,
                                           .noise = alone.noise,
                                           .eotvos_parameter = instrument.eotvos_parameter,
                                           .test = is_test(session) ? &tests[i] : nullptr,
                                           .lost_blocks = lost(i, record.run)};
    record_session_alone(i, signals, alone, session_observer, progress, record);
  }

  template <typename Noise, typename Observer>
  void record_session_alone(std::size_t i, SessionSignals& signals,
                            LaneGroup<double, Noise, Realism>& alone, const Observer& observer,
                            const SessionProgress& progress, RunRecord& record) const {
    Readers readers(*this, i);
    std::vector<float> room;
    const std::span<const float> of_windows = window_weights(i, record.run, room);
    alone.test.window_weights.runs[0] = of_windows.data();
    record_session(signals, setup(i, readers), std::span(&alone, 1), readers.buffer, progress,
                   observer);
    keep(i,
         {alone.sums,
          {.acceleration_m_s2 = alone.loop.largest_acceleration,
           .attitude_rad = alone.loop.largest_angle,
           .monitor = alone.monitor},
          alone.further,
          alone.test.products,
          alone.test.steps},
         record);
  }

  /// A session of a batch, with all that it is computed from.
  struct SessionOfBatch {
    SessionOfBatch(const Impl& impl, std::size_t i, std::span<const Lane> lanes,
                   const SessionProgress& progress)
        : signals(impl.campaign.scenario, impl.campaign.scenario.sessions[i], impl.orbit,
                  impl.environment),
          streams(noise_streams(impl.campaign.scenario.sessions[i].name)),
          readers(impl, i),
          batch{.signals = &signals,
                .setup = impl.setup(i, readers),
                .noise = &impl.noise,
                .streams = &streams,
                .seed = impl.campaign.seed,
                .num_runs = lanes.size(),
                .weights_buffer = readers.buffer,
                .progress = SessionProgress::report_to,
                .progress_context = &progress} {
      const Session& session = impl.campaign.scenario.sessions[i];
      const NoiseStreams starts = start_streams(session.name);
      for (std::size_t l = 0; l < batch_lanes; ++l) {
        const Lane& lane = lanes[std::min(l, lanes.size() - 1)];
        batch.runs[l] = lane.run;
        batch.constants[l] = make_loop_constants(lane.instrument, impl.campaign.scenario, session);
        batch.eotvos_parameters[l] = lane.instrument.eotvos_parameter;
        batch.noise_states[l] = stationary_states(impl.noise, impl.campaign.seed, lane.run, starts);
        batch.window_weights[l] = impl.window_weights(i, lane.run, of_windows[l]).data();
      }
    }
    SessionOfBatch(const SessionOfBatch&) = delete;
    SessionOfBatch& operator=(const SessionOfBatch&) = delete;

    SessionSignals signals;
    NoiseStreams streams;
    Readers readers;
    BatchSession batch;
    std::array<std::vector<float>, batch_lanes> of_windows;
  };

  void keep_all(std::size_t i, std::span<const Lane> lanes, const SessionOutcomes& outcomes,
                std::vector<RunRecord>& records) const {
    for (std::size_t l = 0; l < lanes.size(); ++l) keep(i, outcomes[l], records[lanes[l].index]);
  }

  /// One session after the other.
  void record_in_turn(std::span<const Lane> lanes, BatchKernel kernel, SessionProgress& progress,
                      std::vector<RunRecord>& records) const {
    for (std::size_t i = 0; i < weights.size(); ++i) {
      const auto session = std::make_unique<SessionOfBatch>(*this, i, lanes, progress);
      SessionOutcomes outcomes{};
      kernel(session->batch, outcomes);
      keep_all(i, lanes, outcomes, records);
      progress.end_session(i);
    }
  }

  /// Several sessions side by side.
  void record_side_by_side(std::span<const Lane> lanes, MixedKernel kernel,
                           const SessionProgress& progress, std::vector<RunRecord>& records) const {
    std::vector<std::size_t> order(weights.size());
    std::iota(order.begin(), order.end(), 0U);
    std::ranges::stable_sort(order, std::greater<>(),
                             [&](std::size_t i) { return weights[i].num_samples(); });
    std::deque<SessionOfBatch> sessions;
    std::vector<BatchSession> batches;
    for (const std::size_t i : order) {
      batches.push_back(sessions.emplace_back(*this, i, lanes, progress).batch);
    }
    std::vector<SessionOutcomes> outcomes(order.size());
    kernel(batches, outcomes);
    for (std::size_t k = 0; k < order.size(); ++k) keep_all(order[k], lanes, outcomes[k], records);
  }

  [[nodiscard]] EstimationInput estimation_input() const {
    const Scenario& scenario = campaign.scenario;
    return {.sessions = scenario.sessions,
            .config = scenario.estimation,
            .objectives = scenario.objectives,
            .noise = scenario.noise,
            .attitude = scenario.attitude,
            .laws = laws,
            .orbit_period_s = scenario.orbit.period_s,
            .sample_period_s = scenario.simulation.sample_period_s};
  }

  /// Whether results have standard errors of the calibration: without noise those that it finds
  /// are of noise that was not there.
  [[nodiscard]] bool has_standard_errors() const {
    return method.has_standard_errors && campaign.scenario.noise.scale > 0.0;
  }

  /// Sets the estimates of the calibration and, if the scenario has one, of the test.
  void set_estimates(const RunRecord& record, const Estimation& found, RunResult& result) const {
    result.estimate.assign(found.values.begin(), found.values.end());
    if (has_standard_errors()) {
      result.standard_error.assign(found.standard_errors.begin(), found.standard_errors.end());
    }
    TestEstimation test;
    if (campaign.scenario.has_tests()) {
      test = estimate_ep_test(record.phasors, estimation_input(), found);
      result.estimate.insert(result.estimate.end(), test.values.begin(), test.values.end());
      if (campaign.scenario.noise.scale > 0.0) {
        result.standard_error.push_back(test.standard_error);
      }
    }
    result.correlations = pairs(result.standard_error.size(), [&](std::size_t i, std::size_t j) {
      return j < num_parameters ? found.correlations[i][j] : test.correlations[i];
    });
  }

  /// Whether sessions may be computed side by side: the loops settle for a whole number of noise
  /// blocks, no further lines are recorded, none is a test and none feels stiffness.
  [[nodiscard]] bool may_be_mixed() const {
    const Scenario& scenario = campaign.scenario;
    const SessionSignals signals(scenario, scenario.sessions[0], orbit, environment);
    return signals.num_settling() % std::int64_t{samples_per_noise_block} == 0 &&
           !scenario.has_tests() && !has_stiffness() &&
           std::ranges::all_of(groups, [](const auto& further) { return further.empty(); });
  }
};

RunPlan::RunPlan(const MicroscopeCampaign& campaign)
    : RunPlan(campaign, estimation_method(campaign.scenario.estimation.method)) {}
RunPlan::RunPlan(const MicroscopeCampaign& campaign, const EstimationMethodInfo& method)
    : impl_(std::make_unique<Impl>(campaign, method)) {}
RunPlan::~RunPlan() = default;

int RunPlan::num_steps() const {
  int total = 0;
  for (const Session& session : impl_->campaign.scenario.sessions) total += session.num_orbits;
  return total;
}

RunRecord RunPlan::record(RunIndex run, std::span<const double> table_values,
                          const std::function<void(int)>& progress,
                          const SampleObserver& observer) const {
  const Scenario& scenario = impl_->campaign.scenario;
  const AcceptedDraw draw = draw_instrument(impl_->campaign, run, table_values);
  RunRecord recorded = impl_->drawn_record(run, draw);
  if (!draw.instrument) return recorded;
  SessionProgress sessions(scenario, progress);
  for (std::size_t i = 0; i < scenario.sessions.size(); ++i) {
    impl_->record_session_of_run(i, *draw.instrument, observer, sessions, recorded);
    sessions.end_session(i);
  }
  return recorded;
}

RunResult RunPlan::replay(const RunRequest& request, const SampleSink& sink,
                          const std::function<void(int)>& progress) const {
  std::vector<double> values;
  const auto pass_on = [&](const ObservedSample& sample) {
    if (sample.index < 0) return;  // The loops settle.
    values.clear();
    append_recorded_values(sample, values);
    sink({.session = sample.session, .time_s = sample.time_s, .values = values});
  };
  return estimate(record(request.run, request.table_values, progress, pass_on));
}

const Recording& RunPlan::recording() const { return impl_->recording; }

bool RunPlan::runs_on_devices() const { return gpu::can_simulate(*impl_); }

std::unique_ptr<DeviceSimulation> RunPlan::simulation_on(Device& device) const {
  return std::make_unique<gpu::MicroscopeDeviceSimulation>(*this, *impl_, device);
}

std::vector<RunResult> RunPlan::simulate_batch(std::span<const RunRequest> requests,
                                               InstructionSet set,
                                               const std::function<void(int)>& progress) const {
  std::vector<RunResult> results;
  for (const RunRecord& record : record_batch(requests, set, progress)) {
    results.push_back(estimate(record));
  }
  return results;
}

std::vector<RunRecord> RunPlan::record_batch(std::span<const RunRequest> requests,
                                             InstructionSet set,
                                             const std::function<void(int)>& progress) const {
  PROOFMASS_EXPECT(requests.size() <= batch_lanes);
  std::vector<RunRecord> records;
  if (set == InstructionSet::scalar || !impl_->campaign.scenario.has_plain_loops()) {
    const auto num_runs = static_cast<int>(requests.size());
    for (const auto& [run, table_values] : requests) {
      const int num_before = static_cast<int>(records.size()) * num_steps();
      const auto of_all = [&](int num_orbits_done) {
        if (progress) progress((num_before + num_orbits_done) / num_runs);
      };
      records.push_back(record(run, table_values, of_all));
    }
    return records;
  }
  std::vector<Lane> lanes;
  for (std::size_t i = 0; i < requests.size(); ++i) {
    const auto& [run, table_values] = requests[i];
    const AcceptedDraw draw = draw_instrument(impl_->campaign, run, table_values);
    records.push_back(impl_->drawn_record(run, draw));
    if (draw.instrument) lanes.push_back({.run = run, .instrument = *draw.instrument, .index = i});
  }
  if (lanes.empty()) return records;
  SessionProgress sessions(impl_->campaign.scenario, progress);
  const MixedKernel mixed = mixed_kernel(set, lanes.size());
  if (mixed != nullptr && impl_->may_be_mixed()) {
    impl_->record_side_by_side(lanes, mixed, sessions, records);
  } else {
    impl_->record_in_turn(lanes, batch_kernel(set, lanes.size()), sessions, records);
  }
  return records;
}

Estimation RunPlan::estimation(const RunRecord& record) const {
  return impl_->method.estimate(record.phasors, impl_->estimation_input());
}

RunResult RunPlan::estimate(const RunRecord& record) const {
  const Scenario& scenario = impl_->campaign.scenario;
  RunResult result{.run = record.run, .num_draws = record.num_draws};
  if (!record.has_draw) {
    result.status = RunStatus::no_draw;
    return result;
  }
  result.truth = run_truth(scenario, record.truth, record.eotvos_parameter);
  const Estimation found = estimation(record);
  result.num_rounds = found.num_rounds;
  const bool are_errors_usable =
      impl_->method.has_standard_errors && are_in_range(found.standard_errors);
  const HealthFinding finding =
      judge_health(scenario, impl_->bounds, record.health, record.phasors, record.truth,
                   are_errors_usable ? std::span<const double>(found.standard_errors)
                                     : std::span<const double>());
  for (const HealthValue& value : health_values()) {
    result.health.push_back(finding.health.*value.member);
  }
  result.health.insert(result.health.end(), record.margins.begin(), record.margins.end());
  if (scenario.has_tests()) result.health.push_back(finding.test_residual_m_s2);
  if (finding.loss.cause != LossCause::none) {
    result.status = RunStatus::lost;
    result.loss = {.cause = static_cast<std::uint32_t>(finding.loss.cause),
                   .session = static_cast<std::uint32_t>(finding.loss.session)};
    return result;
  }
  RunResult without_estimates = result;
  impl_->set_estimates(record, found, result);
  if (!are_in_range(result.estimate) || !are_in_range(result.standard_error)) {
    without_estimates.status = RunStatus::not_finite;
    return without_estimates;
  }
  result.status = found.converged ? RunStatus::completed : RunStatus::not_converged;
  if (impl_->has_standard_errors()) {
    result.fit = {0.0, 0.0};
    for (const SessionFit& session : found.session_fits) {
      // A session whose data are all adapted to has none left, but for rounding.
      const double freedom = std::max(session.degrees_of_freedom, 0.0);
      result.fit[0] += session.chi_squared;
      result.fit[1] += freedom;
      result.fit.insert(result.fit.end(), {session.chi_squared, freedom});
    }
  }
  return result;
}

}  // namespace proofmass
