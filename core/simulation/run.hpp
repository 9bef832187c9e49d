#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string_view>

#include "core/campaign/campaign.hpp"
#include "core/campaign/run_result.hpp"
#include "core/estimation/calibration.hpp"

namespace proofmass {

/// Changes with every change of core that may change a result's bits. Coordinator and workers must
/// agree on it, and a campaign is finished by the model that began it.
inline constexpr std::string_view model_version = "hardy2013-1";

/// What a run's simulation leaves for the estimation, and the truth to compare with.
struct RunRecord {
  RunIndex run;
  std::uint32_t num_draws = 0;
  bool has_draw = false;  ///< False if no draw was accepted; then the rest means nothing.
  ParameterArray truth{};
  CalibrationRecord phasors{};
};

/// Everything that the runs of a campaign share: filters, weights, orbit, environment. Made once,
/// used for any run, by one thread at a time.
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

  /// Estimates the ten parameters from a record.
  [[nodiscard]] RunResult estimate(const RunRecord& record) const;

  /// record(), then estimate(): all of a run.
  [[nodiscard]] RunResult simulate(RunIndex run, std::span<const double> table_values,
                                   const std::function<void(int)>& progress = {}) const {
    return estimate(record(run, table_values, progress));
  }

  /// Orbits of one run, all sessions together.
  [[nodiscard]] int num_orbits() const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace proofmass
