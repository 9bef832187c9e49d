#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>

#include "core/microscope/session/session.hpp"
#include "core/microscope/session/session_signals.hpp"
#include "core/microscope/simulation/loop.hpp"

namespace proofmass {

/// One sample of a session of a run, as it passes. Its references hold during the call only.
struct ObservedSample {
  std::size_t session = 0;     ///< Index in the scenario's list.
  std::int64_t index = 0;      ///< 0 is the first of the record; negative while the loops settle.
  double time_s = 0.0;         ///< From the session's start: index times the sample period.
  const SharedSample& shared;  ///< What all runs see alike.
  const Observation<double>& observation;  ///< What instrument and estimator report.
  /// The ground's signals, by index(Signal); all of them, whatever is recorded.
  const std::array<double, num_signals>& signals;
};

/// Called with every sample of a run, in the order of sessions and times.
using SampleObserver = std::function<void(const ObservedSample&)>;

/// The observer of a session that nobody observes. `is_active` is a constant, so that the compiler
/// leaves nothing of it in the sample loop.
struct NoObserver {
  static constexpr bool is_active = false;
};

/// Passes the samples of one session on.
struct SessionObserver {
  static constexpr bool is_active = true;

  const SampleObserver& observe;
  std::size_t session;
  std::int64_t next;  ///< Index of the sample that passes next.
  double sample_period_s;

  void operator()(const SharedSample& shared, const Observation<double>& observation,
                  const std::array<double, num_signals>& signals) {
    observe({.session = session,
             .index = next,
             .time_s = static_cast<double>(next) * sample_period_s,
             .shared = shared,
             .observation = observation,
             .signals = signals});
    ++next;
  }
};

}  // namespace proofmass
