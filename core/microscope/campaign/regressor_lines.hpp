#pragma once

#include <complex>
#include <vector>

#include "core/microscope/campaign/scenario.hpp"
#include "core/microscope/session/session.hpp"

namespace proofmass {

/// A part amplitude·e^(2πi f t) of a signal.
struct SpectralLine {
  double frequency_hz = 0.0;
  std::complex<double> amplitude;
};

/// A real signal: for each line at f there is its conjugate at −f.
using SpectralLines = std::vector<SpectralLine>;

/// The lines of what Γ_mes,dx is fitted against, of a nominal instrument without noise: from the
/// orbit, the spin, the excitations and how the loops answer them. README.md has the equations.
/// @pre The session passed validate_sessions(), and has a target.
[[nodiscard]] SpectralLines regressor_lines(const Scenario& scenario, const Session& session);

/// What a session's fit lines are worth: of each line of Session::fit_lines the amplitude of the
/// regressor, in its unit. Lines nearer than half the session's resolution are one.
[[nodiscard]] std::vector<double> fitted_amplitudes(const Scenario& scenario,
                                                    const Session& session,
                                                    const SpectralLines& regressor);

/// Gain² of the estimation's band-pass at a fit line.
[[nodiscard]] double band_gain_squared(const Scenario& scenario, const Session& session,
                                       double frequency_hz);

/// 1/(1 + L) of the nominal drag-free loop at a frequency.
[[nodiscard]] std::complex<double> drag_free_sensitivity(const DragFreeConfig& config,
                                                         double frequency_hz);

/// Time in which what a session's band-pass answers to the beginning of a record decays by e, s:
/// that of Butterworth's poles at its lower edge.
[[nodiscard]] double band_decay_s(const Scenario& scenario, const Session& session);

/// Time by which a fit divides the density of noise, s: cosine and sine of a line each have the
/// variance S/duration.
[[nodiscard]] double fit_duration_s(const Scenario& scenario, const Session& session);

/// For campaign files; a stored campaign can be read whatever its lines are.
/// @throws ConfigError naming the first of the sessions' fit lines whose regressor is so small that
/// noise makes more of the estimate than construction admits.
void check_regressors(const Scenario& scenario);

}  // namespace proofmass
