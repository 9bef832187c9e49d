#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/runs.hpp"

namespace proofmass::coordinator {

/// Amplitude spectral densities, one-sided, in the signal's unit per √Hz: roots of the mean PSD of
/// neighbouring bins.
struct SpectrumPoint {
  double frequency_hz = 0.0;
  double measured = 0.0;
  double residual = 0.0;  ///< Of what is left when the fitted lines are subtracted.
  double expected = 0.0;  ///< Of the noise model; 0 if there is no noise.
};

/// A line as the session's estimation fits it.
struct SpectrumLine {
  double frequency_hz = 0.0;
  double amplitude = 0.0;  ///< Of the signal before any filter, in its unit.
  double height = 0.0;     ///< That a sine of this amplitude has in the spectrum, unit/√Hz.
  bool is_used = false;    ///< By the estimate; the others are fitted beside those.
};

/// A ratio of noise powers, with a bound of its standard error.
struct NoiseRatio {
  double value = 0.0;
  double standard_error = 0.0;
};

/// The spectrum of a signal in a session of a run.
struct SessionSpectrum {
  std::string session;
  std::string meaning;  ///< Of the signal, a phrase for people.
  std::string unit;
  std::vector<SpectrumPoint> points;  ///< In the order of frequencies.
  std::vector<SpectrumLine> lines;    ///< Those that the estimate uses come first.
  /// Power of what is left of the signal over that of the noise model, from the median of all bins
  /// up to a factor of three away from the lines that the estimate uses, without those of fitted
  /// lines. Empty if there is no noise, or no such bin.
  std::optional<NoiseRatio> noise_ratio;
  std::string noise_meaning;  ///< A sentence for people.
};

/// The spectra of a replayed run.
struct RunSpectra {
  RunIndex run;
  std::vector<SessionSpectrum> sessions;
  std::vector<std::string> reasons;  ///< Sentences: why there are none, or not all.
};

}  // namespace proofmass::coordinator
