#pragma once

// The noise of a kernel; see batch_kernel-inl.hpp.

#include <array>
#include <cstddef>
#include <cstdint>

#include "core/microscope/simulation/batch-inl.hpp"
#include "core/microscope/simulation/batch_kernel.hpp"

namespace proofmass {
namespace {

/// One random word of each run.
struct WordBatch {
  hn::Vec<Words> part[num_vectors];
};

/// Streams and block of a group whose lanes are in the same session.
class SharedStreams {
 public:
  HWY_INLINE explicit SharedStreams(const NoiseStreams& streams) : streams_(streams) {}
  HWY_INLINE hn::Vec<Words> stream(std::size_t channel) const {
    return hn::Set(Words(), std::uint64_t{streams_[channel]});
  }
  HWY_INLINE hn::Vec<Words> block() const { return hn::Set(Words(), std::uint64_t{block_}); }
  HWY_INLINE void next_block() { ++block_; }

 private:
  const NoiseStreams& streams_;
  std::uint32_t block_ = 0;
};

/// Philox4x32-10 [Salmon2011] of counters (block, stream, run) for each run; what is above 32 bits
/// of a word means nothing.
///
/// A round takes (c0, c1, c2, c3) to (hi(M₁c2) ^ c1 ^ k0, lo(M₁c2), hi(M₀c0) ^ c3 ^ k1, lo(M₀c0)).
/// The channels of a run differ in c1 alone, which reaches c0 in the first round, c2 and c3 in the
/// second: until then a product is common to all channels, or even to all blocks of the session.
class BatchPhilox {
 public:
  HWY_INLINE BatchPhilox(const WordBatch& run_low, const WordBatch& run_high, std::uint64_t key)
      : run_high_(run_high) {
    auto key_low = static_cast<std::uint32_t>(key);
    auto key_high = static_cast<std::uint32_t>(key >> 32);
    for (std::size_t round = 0; round < num_rounds; ++round) {
      key_[round][0] = hn::Set(Words(), std::uint64_t{key_low});
      key_[round][1] = hn::Set(Words(), std::uint64_t{key_high});
      key_low += 0x9E3779B9U;
      key_high += 0xBB67AE85U;
    }
    for (std::size_t i = 0; i < num_vectors; ++i) {
      run_product_.part[i] = multiply(second_factor, run_low.part[i]);
      run_word_.part[i] = hn::Xor(high(run_product_.part[i]), key_[0][0]);
    }
  }

  /// Goes to a block of every stream.
  HWY_INLINE void begin(hn::Vec<Words> block) {
    block_product_ = multiply(first_factor, block);
    for (std::size_t i = 0; i < num_vectors; ++i) {
      const auto c2 = hn::Xor3(high(block_product_), run_high_.part[i], key_[0][1]);
      const auto product = multiply(second_factor, c2);
      c1_.part[i] = product;
      const auto c0 = hn::Xor3(high(product), run_product_.part[i], key_[1][0]);
      c0_product_.part[i] = multiply(first_factor, c0);
    }
  }

  /// The words of two pairs of deviates: those that make radii, and those that make angles.
  HWY_INLINE void make(hn::Vec<Words> stream, std::uint32_t (&radius_words)[2][num_lanes],
                       std::uint32_t (&angle_words)[2][num_lanes]) const {
    State states[num_vectors];
    for (std::size_t i = 0; i < num_vectors; ++i) states[i] = make_vector(stream, i);
    store(states, &State::c0, radius_words[0]);
    store(states, &State::c1, angle_words[0]);
    store(states, &State::c2, radius_words[1]);
    store(states, &State::c3, angle_words[1]);
  }

 private:
  static constexpr std::size_t num_rounds = 10;
  static constexpr std::uint64_t first_factor = 0xD2511F53U;
  static constexpr std::uint64_t second_factor = 0xCD9E8D57U;
  using W = hn::Vec<Words>;
  struct State {
    W c0, c1, c2, c3;
  };

  HWY_INLINE static W multiply(std::uint64_t factor, W x) {
    const UnsignedWords halves;
    return hn::MulEven(hn::BitCast(halves, hn::Set(Words(), factor)), hn::BitCast(halves, x));
  }
  HWY_INLINE static W high(W product) { return hn::ShiftRight<32>(product); }

  /// Packs the low halves of all vectors.
  HWY_INLINE static void store(const State (&states)[num_vectors], W State::*word,
                               std::uint32_t (&words)[num_lanes]) {
    const hn::Rebind<std::uint32_t, Words> packed;
    for (std::size_t i = 0; i < num_vectors; ++i) {
      hn::Store(hn::TruncateTo(packed, states[i].*word), packed, words + i * width);
    }
  }

  HWY_INLINE State make_vector(W stream, std::size_t i) const {
    const auto second = multiply(first_factor, hn::Xor(run_word_.part[i], stream));
    const auto c2 = hn::Xor3(high(second), block_product_, key_[1][1]);
    const auto third = multiply(second_factor, c2);
    State state{.c0 = hn::Xor3(high(third), c1_.part[i], key_[2][0]),
                .c1 = third,
                .c2 = hn::Xor3(high(c0_product_.part[i]), second, key_[2][1]),
                .c3 = c0_product_.part[i]};
    for (std::size_t round = 3; round < num_rounds; ++round) advance(round, state);
    return state;
  }

  HWY_INLINE void advance(std::size_t round, State& state) const {
    const W first = multiply(first_factor, state.c0);
    const W second = multiply(second_factor, state.c2);
    state = {.c0 = hn::Xor3(high(second), state.c1, key_[round][0]),
             .c1 = second,
             .c2 = hn::Xor3(high(first), state.c3, key_[round][1]),
             .c3 = first};
  }

  W key_[num_rounds][2];   ///< Of each round.
  WordBatch run_high_;     ///< c3 at first.
  WordBatch run_product_;  ///< c1 after the first round.
  WordBatch run_word_;     ///< c0 after the first round, less the stream.
  W block_product_;        ///< c3 after the first round.
  WordBatch c1_;           ///< After the second round.
  WordBatch c0_product_;   ///< c3 after the third round.
};

using F = hn::Vec<Floats>;

/// log_unit() of core/random/normal_deviates.hpp, line by line.
HWY_INLINE F log_unit(F u) {
  const Floats floats;
  const SignedWords words;
  const auto split = hn::Set(words, 0x3f3504f3);
  const auto shifted = hn::Sub(hn::BitCast(words, u), split);
  const auto exponent = hn::ConvertTo(floats, hn::ShiftRight<23>(shifted));
  const auto m = hn::BitCast(floats, hn::Add(hn::And(shifted, hn::Set(words, 0x007fffff)), split));
  const auto one = hn::Set(floats, 1.0F);
  const auto s = hn::Div(hn::Sub(m, one), hn::Add(m, one));
  const auto z = hn::Mul(s, s);
  auto tail = hn::Mul(z, hn::Set(floats, 2.0F / 9));
  tail = hn::Mul(z, hn::Add(hn::Set(floats, 2.0F / 7), tail));
  tail = hn::Mul(z, hn::Add(hn::Set(floats, 2.0F / 5), tail));
  tail = hn::Mul(z, hn::Add(hn::Set(floats, 2.0F / 3), tail));
  return hn::Add(hn::Mul(exponent, hn::Set(floats, 0.693147180559945F)),
                 hn::Mul(s, hn::Add(hn::Set(floats, 2.0F), tail)));
}

/// sincos_word() of core/random/normal_deviates.hpp, line by line.
HWY_INLINE void sincos_word(hn::Vec<UnsignedWords> word, F& sine, F& cosine) {
  const Floats floats;
  const SignedWords words;
  const UnsignedWords unsigned_words;
  const auto quarter = hn::ShiftRight<30>(hn::Add(word, hn::Set(unsigned_words, 0x20000000U)));
  const auto rest = hn::BitCast(words, hn::Sub(word, hn::ShiftLeft<30>(quarter)));
  const auto x = hn::Mul(hn::ConvertTo(floats, rest), hn::Set(floats, 1.46291807926715968e-9F));
  const auto z = hn::Mul(x, x);
  const auto step = [&](float coefficient, F inner) HWY_ATTR {
    return hn::Sub(hn::Set(floats, coefficient), hn::Mul(z, inner));
  };
  const F s = hn::Mul(
      x, step(1.0F,
              step(1.0F / 6, step(1.0F / 120, step(1.0F / 5040, hn::Set(floats, 1.0F / 362880))))));
  const F c = step(
      1.0F, step(0.5F, step(1.0F / 24, step(1.0F / 720,
                                            step(1.0F / 40320, hn::Set(floats, 1.0F / 3628800))))));
  const auto swapped = hn::MaskFromVec(hn::BitCast(
      floats, hn::Neg(hn::BitCast(words, hn::And(quarter, hn::Set(unsigned_words, 1U))))));
  const F first = hn::IfThenElse(swapped, c, s);
  const F second = hn::IfThenElse(swapped, s, c);
  // The sign bit is bit 1 of the quarter for the sine, of the next quarter for the cosine.
  const auto two = hn::Set(unsigned_words, 2U);
  const auto sine_sign = hn::ShiftLeft<30>(hn::And(quarter, two));
  const auto cosine_sign =
      hn::ShiftLeft<30>(hn::And(hn::Add(quarter, hn::Set(unsigned_words, 1U)), two));
  sine = hn::Xor(first, hn::BitCast(floats, sine_sign));
  cosine = hn::Xor(second, hn::BitCast(floats, cosine_sign));
}

/// The radius of box_muller() in core/random/normal_deviates.hpp, line by line.
HWY_INLINE F radius(hn::Vec<UnsignedWords> word) {
  const Floats floats;
  const auto half_word = hn::BitCast(SignedWords(), hn::ShiftRight<1>(word));
  const auto u = hn::Mul(hn::Add(hn::ConvertTo(floats, half_word), hn::Set(floats, 0.5F)),
                         hn::Set(floats, 0x1p-31F));
  return hn::Sqrt(hn::Mul(hn::Set(floats, -2.0F), log_unit(u)));
}

/// SessionNoise for a group of runs.
template <typename Streams>
class BatchNoise {
 public:
  /// @param session     Of these runs, with the noise of all their sessions.
  /// @param first_lane  Of the group, in the session's lanes.
  HWY_INLINE BatchNoise(const BatchSession& session, const Streams& streams, std::size_t first_lane,
                        const NoiseStates<Batch>& states)
      : model_(*session.noise),
        streams_(streams),
        philox_(philox_of(session, first_lane)),
        states_(states) {}

  /// The reference holds until the next call.
  HWY_INLINE const SampleNoise<Batch>& next() {
    if (next_in_block_ == samples_per_noise_block) {
      make_deviates();
      shape_deviates();
    }
    return block_[next_in_block_++];
  }

  HWY_INLINE Streams& streams() { return streams_; }
  HWY_INLINE NoiseStates<Batch>& states() { return states_; }

 private:
  HWY_INLINE static BatchPhilox philox_of(const BatchSession& session, std::size_t first_lane) {
    alignas(64) std::uint64_t low[num_lanes];
    alignas(64) std::uint64_t high[num_lanes];
    for (std::size_t lane = 0; lane < num_lanes; ++lane) {
      const std::uint64_t run = session.runs[first_lane + lane].value;
      low[lane] = static_cast<std::uint32_t>(run);
      high[lane] = run >> 32;
    }
    WordBatch run_low, run_high;
    for (std::size_t i = 0; i < num_vectors; ++i) {
      run_low.part[i] = hn::Load(Words(), low + i * width);
      run_high.part[i] = hn::Load(Words(), high + i * width);
    }
    return {run_low, run_high, session.seed};
  }

  HWY_INLINE Batch deviate(std::size_t channel, std::size_t i) const {
    const auto& deviates = (i % 2 == 0 ? cosines_ : sines_)[channel][i / 2];
    Batch white;
    for (std::size_t part = 0; part < num_vectors; ++part) {
      white.part[part] = hn::PromoteTo(Doubles(), hn::Load(HalfFloats(), deviates + part * width));
    }
    return white;
  }

  /// Three short loops rather than a long one: the processor overlaps several turns of each.
  HWY_NOINLINE void make_deviates() {
    alignas(64) std::uint32_t radius_words[num_noise_channels][2][num_lanes];
    alignas(64) std::uint32_t angle_words[num_noise_channels][2][num_lanes];
    philox_.begin(streams_.block());
    for (std::size_t channel = 0; channel < num_noise_channels; ++channel) {
      philox_.make(streams_.stream(channel), radius_words[channel], angle_words[channel]);
    }
    const Floats floats;
    const UnsignedWords unsigned_words;
    constexpr std::size_t num_pairs = num_noise_channels * 2 * num_lanes;
    static_assert(num_pairs % HWY_LANES(float) == 0);
    for (std::size_t i = 0; i < num_pairs; i += HWY_LANES(float)) {
      const auto word = hn::Load(unsigned_words, &radius_words[0][0][0] + i);
      hn::Store(radius(word), floats, &cosines_[0][0][0] + i);
    }
    for (std::size_t i = 0; i < num_pairs; i += HWY_LANES(float)) {
      F sine, cosine;
      sincos_word(hn::Load(unsigned_words, &angle_words[0][0][0] + i), sine, cosine);
      const F r = hn::Load(floats, &cosines_[0][0][0] + i);
      hn::Store(hn::Mul(r, cosine), floats, &cosines_[0][0][0] + i);
      hn::Store(hn::Mul(r, sine), floats, &sines_[0][0][0] + i);
    }
    streams_.next_block();
    next_in_block_ = 0;
  }

  HWY_NOINLINE void shape_deviates() {
    const auto white = [&](std::size_t channel) HWY_ATTR {
      OfSamples<Batch> deviates;
      for (std::size_t k = 0; k < deviates.size(); ++k) deviates[k] = deviate(channel, k);
      return deviates;
    };
    shape_block<Batch>(model_, states_, white, block_);
  }

  const NoiseModel& model_;
  Streams streams_;
  BatchPhilox philox_;
  NoiseStates<Batch> states_;
  /// Deviates of samples 0 and 2, and of samples 1 and 3 of a block, by channel.
  alignas(64) float cosines_[num_noise_channels][2][num_lanes];
  alignas(64) float sines_[num_noise_channels][2][num_lanes];
  OfSamples<SampleNoise<Batch>> block_;
  std::size_t next_in_block_ = samples_per_noise_block;
};

}  // namespace
}  // namespace proofmass
