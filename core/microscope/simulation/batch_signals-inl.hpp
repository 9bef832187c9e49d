#pragma once

// The shared signals of a kernel, computed for many samples at once: here a lane is a sample, not a
// run. See batch_kernel-inl.hpp.

#include <array>
#include <cstddef>

#include "core/math/elementary.hpp"
#include "core/microscope/simulation/batch-inl.hpp"
#include "core/microscope/simulation/batch_gather-inl.hpp"
#include "core/microscope/simulation/session_signals.hpp"

namespace proofmass {
namespace {

/// sincos_turns() of core/math/elementary.cpp, line by line.
HWY_INLINE SineCosineOf<Batch> sincos_turns(const Batch& turns) {
  const Batch shifted = Batch(4.0) * turns + Batch(0x1.8p52);
  const auto [s, c] = sincos_series(turns, shifted - Batch(0x1.8p52));
  const Words words;
  const auto one = hn::Set(words, 1U);
  const auto two = hn::Set(words, 2U);
  SineCosineOf<Batch> result;
  for (std::size_t i = 0; i < num_vectors; ++i) {
    const auto quarter = hn::BitCast(words, shifted.part[i]);  // In its last two bits.
    const auto swapped = hn::MaskFromVec(hn::BitCast(
        Doubles(), hn::Neg(hn::BitCast(hn::RebindToSigned<Words>(), hn::And(quarter, one)))));
    // The sign bit is bit 1 of the quarter for the sine, of the next quarter for the cosine.
    const auto sine_sign = hn::ShiftLeft<62>(hn::And(quarter, two));
    const auto cosine_sign = hn::ShiftLeft<62>(hn::And(hn::Add(quarter, one), two));
    result.sine.part[i] =
        hn::Xor(hn::IfThenElse(swapped, c.part[i], s.part[i]), hn::BitCast(Doubles(), sine_sign));
    result.cosine.part[i] =
        hn::Xor(hn::IfThenElse(swapped, s.part[i], c.part[i]), hn::BitCast(Doubles(), cosine_sign));
  }
  return result;
}

/// is_small() of core/microscope/orbit/kepler_orbit.hpp for all lanes.
HWY_INLINE bool is_small(const Batch& move) {
  for (const V& part : move.part) {
    if (!hn::AllTrue(Doubles(), hn::Lt(hn::Abs(part), hn::Set(Doubles(), 1e-8)))) return false;
  }
  return true;
}

/// SessionSignals for a batch of runs.
class BatchSignals {
 public:
  HWY_INLINE explicit BatchSignals(SessionSignals& signals) : signals_(signals) {}

  SessionSignals::Reference reference_at_start() const { return signals_.reference_at_start(); }
  std::int64_t num_settling() const { return signals_.num_settling(); }

  HWY_INLINE const SharedSample& next() {
    if (next_ == num_lanes) refill();
    return samples_[next_++];
  }

 private:
  HWY_NOINLINE void refill() {
    Batch times;
    for (std::size_t i = 0; i < num_lanes; ++i) put_lane(times, signals_.time_s(i), i);
    const std::optional<SamplePhasesOf<Batch>> phases = signals_.phases_at(times);
    if (phases) {
      std::array<SamplePhases, num_lanes> of_samples;
      for (std::size_t i = 0; i < num_lanes; ++i) of_samples[i] = lane_of<SamplePhases>(*phases, i);
      signals_.next(of_samples, samples_);
    } else {
      for (SharedSample& sample : samples_) sample = signals_.next();
    }
    next_ = 0;
  }

  SessionSignals& signals_;
  std::array<SharedSample, num_lanes> samples_;
  std::size_t next_ = num_lanes;
};

}  // namespace
}  // namespace proofmass
