#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

#include "core/microscope/session/session.hpp"
#include "core/microscope/simulation/loop.hpp"
#include "core/microscope/simulation/sample_noise.hpp"
#include "core/microscope/simulation/session_signals.hpp"
#include "core/microscope/simulation/test_record.hpp"

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
  /// The loop as the sample found it: the true motion, and the commands that act in the sample.
  const Loop<double>& loop;
  const LoopConstants<double>& constants;
  const SampleNoise<double>& noise;  ///< Of this sample.
  Violation<double> violation;       ///< 0 in a session that does not test.
  bool is_lost = false;              ///< In a block of which the ground lacks data.
};

/// Called with every sample of a run, in the order of sessions and times.
using SampleObserver = std::function<void(const ObservedSample&)>;

/// The observer of a session that nobody observes. `is_active` is a constant, so that the compiler
/// leaves nothing of it in the sample loop.
struct NoObserver {
  static constexpr bool is_active = false;
};

/// The noise of a session, which keeps each sample until the next for an observer.
class ObservedNoise {
 public:
  explicit ObservedNoise(SessionNoise noise) : noise_(std::move(noise)) {}

  const SampleNoise<double>& next() { return last_ = noise_.next(); }
  [[nodiscard]] const SampleNoise<double>& last() const { return last_; }

 private:
  SessionNoise noise_;
  SampleNoise<double> last_;
};

/// Passes the samples of one session on.
struct SessionObserver {
  static constexpr bool is_active = true;

  const SampleObserver& observe;
  std::size_t session;
  std::int64_t next;  ///< Index of the sample that passes next.
  double sample_period_s;
  const LoopConstants<double>& constants;
  const ObservedNoise& noise;
  double eotvos_parameter = 0.0;
  const TestSetup* test = nullptr;  ///< Null in a session that does not test.
  std::vector<bool> lost_blocks{};  ///< Of the record; as many as a test has.
  Loop<double> loop{};              ///< Before the sample.

  /// Tells it the loop that a sample is about to advance.
  void begin_sample(const Loop<double>& before) { loop = before; }

  void operator()(const SharedSample& shared, const Observation<double>& observation,
                  const std::array<double, num_signals>& signals) {
    observe({.session = session,
             .index = next,
             .time_s = static_cast<double>(next) * sample_period_s,
             .shared = shared,
             .observation = observation,
             .signals = signals,
             .loop = loop,
             .constants = constants,
             .noise = noise.last(),
             .violation = test == nullptr
                              ? Violation<double>{}
                              : Violation<double>{eotvos_parameter, test->gravity_m_s2(shared)},
             .is_lost = is_lost()});
    ++next;
  }

 private:
  [[nodiscard]] bool is_lost() const {
    const std::int64_t block = next / std::int64_t{test_block_size};
    return next >= 0 && std::cmp_less(block, lost_blocks.size()) &&
           lost_blocks[static_cast<std::size_t>(block)];
  }
};

}  // namespace proofmass
