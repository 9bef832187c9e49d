#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "core/signal/line_weights.hpp"

namespace proofmass {

// The time series of a run. No simulation keeps them: Plan::replay() computes a run again and
// passes each sample on to a SampleSink, and a Recording says what its numbers are.

/// A signal of a simulation: a number in each sample.
struct RecordedSignal {
  std::string name;     ///< In files, unique in its group: `mass_1_K_x`; [A-Za-z0-9_]+.
  std::string unit;     ///< For people, SI: `m/s²`, `rad` or `1`.
  std::string frame;    ///< Of the component, one of Recording::frames; empty if it has none.
  std::string meaning;  ///< A phrase for people.
};

/// Signals that are read together, with the same times.
struct SignalGroup {
  std::string name;     ///< In files, unique: `measured`; [A-Za-z0-9_]+.
  std::string meaning;  ///< A phrase for people.
  std::vector<RecordedSignal> signals;
};

/// A part of a run with equally spaced samples.
struct RecordedSession {
  std::string name;  ///< In files, unique: `a_c13`; [A-Za-z0-9_]+.
  double sample_period_s = 1.0;
  std::uint64_t num_samples = 0;
};

/// A frame that components of vectors are in.
struct RecordedFrame {
  std::string name;     ///< `S`.
  std::string meaning;  ///< A phrase for people.
};

/// What a model expects of a signal of a session: lines, which its estimation fits, over noise.
struct ExpectedSpectrum {
  std::size_t session = 0;  ///< Index in Recording::sessions.
  std::size_t value = 0;    ///< The signal: index in RecordedSample::values.
  /// The first is of the lines that the estimate uses, as it fits them; the others are of those
  /// fitted beside them. Each is of a record with as many samples as the session.
  std::vector<LineFit> fits;
  /// One-sided PSD of the noise at a frequency above 0 in Hz, unit²/Hz; 0 if there is none.
  std::function<double(double)> noise_psd;
  std::string noise_meaning;  ///< What is noise here, and what is left out: a sentence for people.
};

/// What a replay of any run of a campaign passes on.
struct Recording {
  std::vector<RecordedFrame> frames;
  std::vector<SignalGroup> groups;        ///< The order of the values of a sample is theirs.
  std::vector<RecordedSession> sessions;  ///< In the order in which they are simulated.
  std::vector<ExpectedSpectrum> spectra;  ///< In the order of their sessions; may be none.
};

/// One sample of a replay. The values live during the call only.
struct RecordedSample {
  std::size_t session = 0;         ///< Index in Recording::sessions.
  double time_s = 0.0;             ///< From the session's start; the first is 0.
  std::span<const double> values;  ///< Of all signals of all groups, in their order.
};

}  // namespace proofmass
