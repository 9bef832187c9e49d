#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "core/campaign/campaign.hpp"
#include "core/campaign/run_result.hpp"
#include "core/estimation/calibration.hpp"
#include "core/simulation/instruction_set.hpp"
#include "core/simulation/run_health.hpp"

namespace proofmass {

/// Changes with every change of core that may change a result's bits. Coordinator and workers must
/// agree on it, and a campaign is finished by the model that began it.
inline constexpr std::string_view model_version = "hardy2013-3";

/// Runs that one batch advances together at most.
inline constexpr std::size_t batch_lanes = 16;

/// A run to be simulated, with campaign.table_values(run).
struct RunRequest {
  RunIndex run;
  std::vector<double> table_values;
};

/// What a run's simulation leaves for the estimation, and the truth to compare with.
struct RunRecord {
  RunIndex run;
  std::uint32_t num_draws = 0;
  bool has_draw = false;  ///< False if no draw was accepted; then the rest means nothing.
  ParameterArray truth{};
  CalibrationRecord phasors{};
  HealthRecord health{};
};

/// Everything that the runs of a campaign share: filters, weights, orbit, environment. Made once,
/// used for any run, by any number of threads.
class RunPlan {
 public:
  /// @pre campaign.validate() passed.
  explicit RunPlan(const Campaign& campaign);
  ~RunPlan();
  RunPlan(RunPlan&&) noexcept;
  RunPlan& operator=(RunPlan&&) noexcept;

  /// Draws an instrument and simulates all sessions. A pure function of the campaign and the
  /// arguments.
  ///
  /// @param table_values  campaign.table_values(run).
  /// @param progress      Called several times an orbit with the number of orbits done.
  [[nodiscard]] RunRecord record(RunIndex run, std::span<const double> table_values,
                                 const std::function<void(int)>& progress = {}) const;

  /// record() for several runs at once; arguments as for simulate_batch(), `set` not `scalar`.
  [[nodiscard]] std::vector<RunRecord> record_batch(
      std::span<const RunRequest> requests, InstructionSet set,
      const std::function<void(int)>& progress = {}) const;

  /// Estimates the ten parameters from a record, unless its loops left their limits.
  [[nodiscard]] RunResult estimate(const RunRecord& record) const;

  /// record(), then estimate(): all of a run.
  [[nodiscard]] RunResult simulate(RunIndex run, std::span<const double> table_values,
                                   const std::function<void(int)>& progress = {}) const {
    return estimate(record(run, table_values, progress));
  }

  /// simulate() for several runs at once, bit for bit the same results, in the order of `requests`.
  ///
  /// @param requests  At most batch_lanes; a batch that is not full costs no more than a full one.
  /// @param set       One of available_instruction_sets().
  /// @param progress  As for simulate(); the runs advance together.
  [[nodiscard]] std::vector<RunResult> simulate_batch(
      std::span<const RunRequest> requests, InstructionSet set,
      const std::function<void(int)>& progress = {}) const;

  /// Orbits of one run, all sessions together.
  [[nodiscard]] int num_orbits() const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace proofmass
