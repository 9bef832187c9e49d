#pragma once

#include <array>

#include "core/microscope/estimation/methods.hpp"

namespace proofmass {

/// What the tests of a run find.
struct TestEstimation {
  TestArray values{};           ///< SI.
  double standard_error = 0.0;  ///< Of the Eötvös parameter; nothing bounds what the others lack.
  ParameterArray correlations{};  ///< Of the Eötvös parameter with the calibration's estimates.
};

/// Estimates the Eötvös parameter, with a_c11Δx and a_c11Δz, from all sessions of a run that test:
/// corrects Γ_mes,dx by what the calibration found, then fits it by least squares. README.md has
/// the equations.
///
/// The standard error is that of the sensors' noise at the lines, without noise (noise.scale 0) of
/// scale 1, and of the calibration if this has standard errors.
///
/// @param calibration  The estimates of the same run.
/// @pre One of the sessions is a test.
[[nodiscard]] TestEstimation estimate_ep_test(const RunPhasors& records,
                                              const EstimationInput& input,
                                              const Estimation& calibration);

/// Amplitude of Γ_mes,c as the gravity at O_sat turns in S, at f_EP therefore, in what a test's
/// session did not lose: the largest of an axis, m/s²; 0 if too little is left. README.md has the
/// equation.
[[nodiscard]] double test_residual_m_s2(const SessionPhasors& record);

/// One-sided density of Γ_mes,dx averaged over the windows of a test, (m/s²)²/Hz, at a frequency
/// below half of the rate of windows: that of half the difference of two sensors behind the
/// window's gain, with what the average folds down from multiples of that rate.
[[nodiscard]] double window_noise_psd(const SensorNoise& sensor, double frequency_hz,
                                      double sample_period_s);

}  // namespace proofmass
