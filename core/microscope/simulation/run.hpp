#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "core/campaign/campaign.hpp"
#include "core/campaign/run_result.hpp"
#include "core/math/instruction_set.hpp"
#include "core/microscope/campaign/microscope_campaign.hpp"
#include "core/microscope/estimation/methods.hpp"
#include "core/microscope/simulation/observer.hpp"
#include "core/microscope/simulation/run_health.hpp"

namespace proofmass {

/// Changes with every change of core that may change a result's bits, or which runs are lost.
/// Coordinator and workers must agree on it, and a campaign is finished by the model that began it.
inline constexpr std::string_view model_version = "hardy2013-15";

/// Runs that one batch advances together at most.
inline constexpr std::size_t batch_lanes = 16;

/// What a run's simulation leaves for the estimation, and the truth to compare with. Lists are of
/// the scenario's sessions, in their order.
struct RunRecord {
  RunIndex run;
  std::uint32_t num_draws = 0;    ///< Draws taken until one was accepted.
  bool has_draw = false;          ///< False if none was; then the rest means nothing.
  ParameterArray truth{};         ///< true_parameters() of the draw, SI.
  double eotvos_parameter = 0.0;  ///< δ of the draw.
  RunPhasors phasors{};           ///< With the lines and signals that the method needs.
  HealthRecord health{};          ///< For judge_health().
  std::vector<double> margins{};  ///< Of margin_quantities(), of loops that are not the paper's.
};

/// True value of each quantity of the results: of the ten parameters, and of those of a test if the
/// scenario has one.
/// @param truth             true_parameters(), SI.
/// @param eotvos_parameter  δ.
[[nodiscard]] std::vector<double> run_truth(const Scenario& scenario, const ParameterArray& truth,
                                            double eotvos_parameter);

/// Everything that the runs of a campaign share: filters, weights, orbit, environment. Made once,
/// used for any run, by any number of threads.
class RunPlan final : public Plan {
 public:
  /// @pre campaign.validate() passed.
  explicit RunPlan(const MicroscopeCampaign& campaign);

  /// A plan that estimates by another method than the campaign's.
  /// @pre method.check() passed for the campaign's sessions.
  RunPlan(const MicroscopeCampaign& campaign, const EstimationMethodInfo& method);
  ~RunPlan() override;

  /// Draws an instrument and simulates all sessions. A pure function of the campaign and the
  /// arguments.
  ///
  /// @param table_values  campaign.table_values(run).
  /// @param progress      Called several times an orbit with the number of orbits done.
  /// @param observer      If there is one, it gets every sample of every session. It changes no
  /// bit,
  ///                      and makes no other call any slower.
  [[nodiscard]] RunRecord record(RunIndex run, std::span<const double> table_values,
                                 const std::function<void(int)>& progress = {},
                                 const SampleObserver& observer = {}) const;

  /// record() for several runs at once; arguments as for simulate_batch().
  [[nodiscard]] std::vector<RunRecord> record_batch(
      std::span<const RunRequest> requests, InstructionSet set,
      const std::function<void(int)>& progress = {}) const;

  /// All that the method makes of a record.
  /// @pre record.has_draw.
  [[nodiscard]] Estimation estimation(const RunRecord& record) const;

  /// The result of a record: its estimation, unless its loops left their limits.
  [[nodiscard]] RunResult estimate(const RunRecord& record) const;

  /// record(), then estimate(): all of a run.
  [[nodiscard]] RunResult simulate(RunIndex run, std::span<const double> table_values,
                                   const std::function<void(int)>& progress = {}) const {
    return estimate(record(run, table_values, progress));
  }

  /// simulate() for several runs at once, bit for bit the same results.
  ///
  /// @param requests  At most batch_lanes; up to half as many take about half of the time.
  [[nodiscard]] std::vector<RunResult> simulate_batch(
      std::span<const RunRequest> requests, InstructionSet set,
      const std::function<void(int)>& progress = {}) const override;

  /// record(), then estimate(). The sink gets nothing of what the loops do while they settle.
  [[nodiscard]] RunResult replay(const RunRequest& request, const SampleSink& sink,
                                 const std::function<void(int)>& progress = {}) const override;
  [[nodiscard]] const Recording& recording() const override;
  [[nodiscard]] bool runs_on_devices() const override;
  [[nodiscard]] std::unique_ptr<DeviceSimulation> simulation_on(Device& device) const override;

  /// Orbits of all sessions together.
  [[nodiscard]] int num_steps() const override;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace proofmass
