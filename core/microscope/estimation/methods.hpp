#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "core/microscope/control/control_config.hpp"
#include "core/microscope/estimation/estimation_config.hpp"
#include "core/microscope/instrument/drawn_moments.hpp"
#include "core/microscope/instrument/noise_config.hpp"
#include "core/microscope/results/results.hpp"
#include "core/microscope/session/session.hpp"
#include "core/signal/band_pass.hpp"

namespace proofmass {

/// What the sessions of a run left: one entry for each of scenario.sessions, in their order.
using RunPhasors = std::vector<SessionPhasors>;

/// How well a session agrees with what was estimated from all of them.
struct SessionFit {
  double chi_squared = 0.0;
  /// What chi_squared is expected to be: the session's data less what the fit adapted to them.
  double degrees_of_freedom = 0.0;
};

/// What a method makes of a run.
struct Estimation {
  ParameterArray values{};           ///< SI.
  ParameterArray standard_errors{};  ///< SI; stored if the method has_standard_errors.
  std::uint32_t num_rounds = 0;
  bool converged = false;  ///< False if values still moved in the last allowed round.
  /// Correlations of the estimates; stored likewise.
  std::array<ParameterArray, num_parameters> correlations{};
  std::vector<SessionFit> session_fits{};  ///< As many as sessions, or none.
};

/// A line that a method wants recorded beside the session's fit lines.
struct WantedLine {
  LineMultiple line;
  LineSignals signals;
};

/// What a method wants recorded of a session. Lines cost time in every sample, so that they are
/// recorded for the methods that use them.
struct RecordNeeds {
  SignalSet signals = SignalSet::common;  ///< At Session::fit_lines.
  std::vector<WantedLine> lines{};        ///< Further lines.
  /// Lines that are fitted together with the further ones, so that they do not leak into them. One
  /// that the record cannot tell from a line before it is left out.
  std::vector<LineMultiple> neighbours{};
};

/// Centre of the band-pass behind which a session's fit lines are recorded, Hz: their mean.
[[nodiscard]] double band_centre_hz(const Session& session, double orbit_period_s);
/// That band-pass, from band_ratio below the centre to band_ratio above it.
[[nodiscard]] BandPass fit_lines_filter(const Session& session, const EstimationConfig& config,
                                        double orbit_period_s, double sample_period_s);

/// The filter behind which a session's further lines are recorded: a low-pass at band_ratio times
/// the highest of them and of their neighbours, but at half of the Nyquist frequency at most. It
/// keeps fast noise from leaking into the lines. There is no high-pass: what it would make of an
/// excitation as the record begins lasts for hours, and no line fits it.
[[nodiscard]] BandPass further_lines_filter(const RecordNeeds& needs, const Session& session,
                                            const EstimationConfig& config, double orbit_period_s,
                                            double sample_period_s);

/// What a method may know beside the records of a run: the scenario, apart from what is simulated
/// only. References hold during the call.
struct EstimationInput {
  const std::vector<Session>& sessions;  ///< For which `check` passed.
  const EstimationConfig& config;
  const ParameterArray& objectives;  ///< SI.
  const NoiseConfig& noise;
  const AttitudeConfig& attitude;
  const DrawnMoments& laws;  ///< Of the laws by which instruments are drawn.
  double orbit_period_s = 0.0;
  double sample_period_s = 0.0;
};

/// A way to get the parameters from the phasors of a run; `estimation.method` chooses one.
struct EstimationMethodInfo {
  std::string_view name;  ///< In campaign files: `hardy2013`.

  RecordNeeds (*needs)(const Session& session);

  /// @throws ConfigError if the method cannot estimate all parameters from these sessions.
  void (*check)(const std::vector<Session>& sessions);

  /// A pure function of its arguments.
  /// @param records  Of the sessions, in their order, with what `needs` asks for.
  Estimation (*estimate)(const RunPhasors& records, const EstimationInput& input);

  bool has_standard_errors = false;
};

/// Those that a campaign file can name.
[[nodiscard]] std::span<const EstimationMethodInfo> estimation_methods();

/// What results are where a method with standard errors may be chosen: microscope_results() with
/// these, χ² and its degrees of freedom. Runs that another method estimates have none.
[[nodiscard]] ResultSchema results_with_errors();

/// Whether χ² of a fit is so large that noise of the densities that the weights are made of makes
/// it so with a chance below 1e-6, though these be wrong by their tolerance.
[[nodiscard]] bool is_beyond_chance(double chi_squared, double degrees_of_freedom);

/// Adds χ² and degrees of freedom of each session, `chi_squared_a_c12` and
/// `degrees_of_freedom_a_c12`, as RunResult::fit has them for methods with standard errors.
void add_session_fits(const std::vector<Session>& sessions, ResultSchema& schema);

/// The method that a scenario names.
/// @pre Scenario::validate() passed.
[[nodiscard]] const EstimationMethodInfo& estimation_method(EstimationMethod method);

}  // namespace proofmass
