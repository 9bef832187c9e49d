#pragma once

#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "core/microscope/estimation/estimation_config.hpp"
#include "core/microscope/results/results.hpp"
#include "core/microscope/session/session.hpp"

namespace proofmass {

/// What the sessions of a run left: one entry for each of scenario.sessions, in their order.
using RunPhasors = std::vector<SessionPhasors>;

/// A number that tells how an estimation went.
struct Diagnostic {
  std::string_view name;  ///< With its unit; of a constant string.
  double value = 0.0;
};

/// What a method makes of a run.
struct Estimation {
  ParameterArray values{};           ///< SI.
  ParameterArray standard_errors{};  ///< SI; if the method has_standard_errors.
  std::uint32_t num_rounds = 0;
  bool converged = false;  ///< False if values still moved in the last allowed round.
  std::vector<Diagnostic> diagnostics{};
};

/// Whether the phasors of Session::known_lines are recorded beside those of fit_lines.
enum class RecordedLines : std::uint8_t { fitted, all };

/// What a method wants recorded of a session. Known lines are many and cost as much as those that
/// are fitted; so they are recorded for the methods that use them.
struct RecordNeeds {
  RecordedLines lines = RecordedLines::fitted;
  SignalSet signals = SignalSet::common;
};

/// A way to get the parameters from the phasors of a run; `estimation.method` chooses one.
struct EstimationMethodInfo {
  std::string_view name;  ///< In campaign files: `hardy2013`.

  RecordNeeds (*needs)(const Session& session);

  /// @throws ConfigError if the method cannot estimate all parameters from these sessions.
  void (*check)(const std::vector<Session>& sessions);

  /// A pure function of its arguments.
  /// @param records     Of the sessions, in their order, with what `needs` asks for.
  /// @param sessions    For which `check` passed.
  /// @param objectives  Those of the scenario, SI.
  Estimation (*estimate)(const RunPhasors& records, const std::vector<Session>& sessions,
                         const EstimationConfig& config, const ParameterArray& objectives);

  bool has_standard_errors = false;
};

/// Those that a campaign file can name.
[[nodiscard]] std::span<const EstimationMethodInfo> estimation_methods();

/// What results are where these methods can be chosen: microscope_results(), with standard errors
/// if one of the methods has them. Runs that another one estimates have none.
[[nodiscard]] ResultSchema results_of(std::span<const EstimationMethodInfo> methods);

/// The method that a scenario names.
/// @pre Scenario::validate() passed.
[[nodiscard]] const EstimationMethodInfo& estimation_method(EstimationMethod method);

}  // namespace proofmass
