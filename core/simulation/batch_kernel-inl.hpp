#pragma once

// The kernel of one instruction set. Included once by each batch_kernel_<set>.cpp, which is
// compiled with that set's flags and defines PROOFMASS_KERNEL_SET, the ending of the names of the
// functions to be made.
//
// Everything over `Batch` has internal linkage, because `Batch` has: no symbol of this file can be
// taken for another translation unit's, so no code of a faster processor reaches a slower one.

#include <hwy/highway.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "core/simulation/batch_kernel.hpp"

namespace proofmass {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using Doubles = hn::ScalableTag<double>;
using Words = hn::ScalableTag<std::uint64_t>;   // One 32-bit word in the low half of each.
using Floats = hn::ScalableTag<float>;          // Twice as many as Doubles.
using HalfFloats = hn::Rebind<float, Doubles>;  // As many as Doubles.
using SignedWords = hn::RebindToSigned<Floats>;
using UnsignedWords = hn::RebindToUnsigned<Floats>;

constexpr std::size_t width = HWY_LANES(double);
constexpr std::size_t num_vectors = batch_lanes / width;  ///< Of doubles in a batch.
constexpr std::size_t num_float_vectors = num_vectors / 2;
static_assert(batch_lanes % (2 * width) == 0);

/// One double of each of batch_lanes runs.
struct Batch {
  hn::Vec<Doubles> part[num_vectors];

  HWY_INLINE Batch() : Batch(0.0) {}
  HWY_INLINE explicit Batch(double value) {
    for (auto& p : part) p = hn::Set(Doubles(), value);
  }
};

template <typename Function>
HWY_INLINE Batch map(const Batch& a, const Function& function) {
  Batch result;
  for (std::size_t i = 0; i < num_vectors; ++i) result.part[i] = function(a.part[i]);
  return result;
}
template <typename Function>
HWY_INLINE Batch map(const Batch& a, const Batch& b, const Function& function) {
  Batch result;
  for (std::size_t i = 0; i < num_vectors; ++i) result.part[i] = function(a.part[i], b.part[i]);
  return result;
}

using V = hn::Vec<Doubles>;
HWY_INLINE Batch operator+(const Batch& a, const Batch& b) {
  return map(a, b, [](V x, V y) HWY_ATTR { return hn::Add(x, y); });
}
HWY_INLINE Batch operator-(const Batch& a, const Batch& b) {
  return map(a, b, [](V x, V y) HWY_ATTR { return hn::Sub(x, y); });
}
HWY_INLINE Batch operator*(const Batch& a, const Batch& b) {
  return map(a, b, [](V x, V y) HWY_ATTR { return hn::Mul(x, y); });
}
HWY_INLINE Batch operator-(const Batch& a) {
  return map(a, [](V x) HWY_ATTR { return hn::Neg(x); });
}
HWY_INLINE Batch sqrt(const Batch& a) {
  return map(a, [](V x) HWY_ATTR { return hn::Sqrt(x); });
}

/// One random word of each run.
struct WordBatch {
  hn::Vec<Words> part[num_vectors];
};

/// Philox4x32-10 [Salmon2011] for each run; what is above 32 bits of a word means nothing.
HWY_INLINE void philox_batch(std::uint32_t block, std::uint32_t stream, const WordBatch& run_low,
                             const WordBatch& run_high, std::uint64_t key, WordBatch (&word)[4]) {
  const Words words;
  const UnsignedWords halves;
  const auto multiply = [&](std::uint64_t factor, hn::Vec<Words> x) HWY_ATTR {
    return hn::MulEven(hn::BitCast(halves, hn::Set(words, factor)), hn::BitCast(halves, x));
  };
  for (std::size_t i = 0; i < num_vectors; ++i) {
    auto c0 = hn::Set(words, std::uint64_t{block});
    auto c1 = hn::Set(words, std::uint64_t{stream});
    auto c2 = run_low.part[i];
    auto c3 = run_high.part[i];
    auto key_low = static_cast<std::uint32_t>(key);
    auto key_high = static_cast<std::uint32_t>(key >> 32);
    for (int round = 0; round < 10; ++round) {
      const auto product0 = multiply(0xD2511F53U, c0);
      const auto product1 = multiply(0xCD9E8D57U, c2);
      c0 = hn::Xor(hn::Xor(hn::ShiftRight<32>(product1), c1),
                   hn::Set(words, std::uint64_t{key_low}));
      c1 = product1;
      c2 = hn::Xor(hn::Xor(hn::ShiftRight<32>(product0), c3),
                   hn::Set(words, std::uint64_t{key_high}));
      c3 = product0;
      key_low += 0x9E3779B9U;
      key_high += 0xBB67AE85U;
    }
    word[0].part[i] = c0;
    word[1].part[i] = c1;
    word[2].part[i] = c2;
    word[3].part[i] = c3;
  }
}

using F = hn::Vec<Floats>;

/// log_unit() of core/random/normal.cpp, line by line.
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

/// sincos_word() of core/random/normal.cpp, line by line.
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

/// box_muller() of core/random/normal.cpp for each run.
HWY_INLINE void box_muller(const WordBatch& radius_word, const WordBatch& angle_word,
                           float* HWY_RESTRICT first, float* HWY_RESTRICT second) {
  const Floats floats;
  const SignedWords words;
  const UnsignedWords unsigned_words;
  for (std::size_t i = 0; i < num_float_vectors; ++i) {
    const auto low_words = [&](const WordBatch& batch) HWY_ATTR {
      return hn::ConcatEven(unsigned_words, hn::BitCast(unsigned_words, batch.part[2 * i + 1]),
                            hn::BitCast(unsigned_words, batch.part[2 * i]));
    };
    const auto half_word = hn::BitCast(words, hn::ShiftRight<1>(low_words(radius_word)));
    const auto u = hn::Mul(hn::Add(hn::ConvertTo(floats, half_word), hn::Set(floats, 0.5F)),
                           hn::Set(floats, 0x1p-31F));
    const auto radius = hn::Sqrt(hn::Mul(hn::Set(floats, -2.0F), log_unit(u)));
    F sine;
    F cosine;
    sincos_word(low_words(angle_word), sine, cosine);
    hn::Store(hn::Mul(radius, cosine), floats, first + i * 2 * width);
    hn::Store(hn::Mul(radius, sine), floats, second + i * 2 * width);
  }
}

/// SessionNoise for a batch.
class BatchNoise {
 public:
  HWY_INLINE explicit BatchNoise(const BatchSession& session)
      : model_(*session.noise), streams_(*session.streams), seed_(session.seed) {
    alignas(64) std::uint64_t low[batch_lanes];
    alignas(64) std::uint64_t high[batch_lanes];
    for (std::size_t lane = 0; lane < batch_lanes; ++lane) {
      low[lane] = static_cast<std::uint32_t>(session.runs[lane].value);
      high[lane] = session.runs[lane].value >> 32;
    }
    for (std::size_t i = 0; i < num_vectors; ++i) {
      run_low_.part[i] = hn::Load(Words(), low + i * width);
      run_high_.part[i] = hn::Load(Words(), high + i * width);
    }
  }

  NoiseStates<Batch>& states() { return states_; }

  HWY_INLINE SampleNoise<Batch> next() {
    if (next_in_block_ == samples_per_noise_block) refill();
    const std::size_t i = next_in_block_++;
    return shape_sample<Batch>(model_, states_,
                               [&](std::size_t channel) HWY_ATTR { return deviate(channel, i); });
  }

  /// Makes a sample's deviates for all channels and returns that of the first.
  HWY_INLINE Batch next_deviate() {
    if (next_in_block_ == samples_per_noise_block) refill();
    return deviate(0, next_in_block_++);
  }

 private:
  HWY_INLINE Batch deviate(std::size_t channel, std::size_t i) const {
    Batch white;
    for (std::size_t part = 0; part < num_vectors; ++part) {
      white.part[part] =
          hn::PromoteTo(Doubles(), hn::Load(HalfFloats(), deviates_[channel][i] + part * width));
    }
    return white;
  }

  HWY_NOINLINE void refill() {
    for (std::size_t channel = 0; channel < num_noise_channels; ++channel) {
      WordBatch word[4];
      philox_batch(num_blocks_, streams_[channel], run_low_, run_high_, seed_, word);
      float(&deviate)[samples_per_noise_block][batch_lanes] = deviates_[channel];
      box_muller(word[0], word[1], deviate[0], deviate[1]);
      box_muller(word[2], word[3], deviate[2], deviate[3]);
    }
    ++num_blocks_;
    next_in_block_ = 0;
  }

  const NoiseModel& model_;
  const NoiseStreams& streams_;
  std::uint64_t seed_;
  WordBatch run_low_, run_high_;
  NoiseStates<Batch> states_;
  alignas(64) float deviates_[num_noise_channels][samples_per_noise_block][batch_lanes];
  std::uint32_t num_blocks_ = 0;
  std::size_t next_in_block_ = samples_per_noise_block;
};

/// Gathers one number of each lane.
template <typename Get>
HWY_INLINE Batch gather(const Get& get) {
  alignas(64) double values[batch_lanes];
  for (std::size_t lane = 0; lane < batch_lanes; ++lane) values[lane] = get(lane);
  Batch batch;
  for (std::size_t i = 0; i < num_vectors; ++i) {
    batch.part[i] = hn::Load(Doubles(), values + i * width);
  }
  return batch;
}

template <typename Get>
HWY_INLINE Vector3<Batch> gather_vector(const Get& get) {
  return {gather([&](std::size_t lane) { return get(lane).x; }),
          gather([&](std::size_t lane) { return get(lane).y; }),
          gather([&](std::size_t lane) { return get(lane).z; })};
}

template <typename Get>
HWY_INLINE Matrix3<Batch> gather_matrix(const Get& get) {
  return {{{gather_vector([&](std::size_t lane) { return get(lane).row[0]; }),
            gather_vector([&](std::size_t lane) { return get(lane).row[1]; }),
            gather_vector([&](std::size_t lane) { return get(lane).row[2]; })}}};
}

HWY_INLINE SensorModel<Batch> gather_sensor(const BatchSession& session, std::size_t k) {
  const auto sensor = [&](std::size_t lane) -> const SensorModel<double>& {
    return session.constants[lane].sensors[k];
  };
  return {gather_vector([&](std::size_t lane) { return sensor(lane).rest_position_m; }),
          gather_vector([&](std::size_t lane) { return sensor(lane).motion_direction; }),
          gather_vector([&](std::size_t lane) { return sensor(lane).parasitic_m_s2; }),
          gather_vector([&](std::size_t lane) { return sensor(lane).offset_m_s2; }),
          gather_matrix([&](std::size_t lane) { return sensor(lane).sensitivity; }),
          gather_vector([&](std::size_t lane) { return sensor(lane).quadratic_s2_m; })};
}

HWY_INLINE LoopConstants<Batch> gather_constants(const BatchSession& session) {
  const auto of = [&](std::size_t lane) -> const LoopConstants<double>& {
    return session.constants[lane];
  };
  return {{gather_sensor(session, 0), gather_sensor(session, 1)},
          {gather([&](std::size_t lane) { return of(lane).drag_free_weight[0]; }),
           gather([&](std::size_t lane) { return of(lane).drag_free_weight[1]; })},
          gather_vector([&](std::size_t lane) { return of(lane).subtracted_bias_m_s2; }),
          gather_matrix([&](std::size_t lane) { return of(lane).thrust_matrix; }),
          gather_vector([&](std::size_t lane) { return of(lane).angular_bias_rad_s2; }),
          gather_vector([&](std::size_t lane) { return of(lane).star_tracker_bias_rad; })};
}

HWY_INLINE void gather_states(const BatchSession& session, NoiseStates<Batch>& states) {
  for (std::size_t channel = 0; channel < num_coloured_channels; ++channel) {
    const auto of = [&](std::size_t lane) -> const NoiseState<double>& {
      return session.noise_states[lane][channel];
    };
    for (std::size_t i = 0; i < NoiseShape::num_poles_max; ++i) {
      states[channel].real[i] = gather([&](std::size_t lane) { return of(lane).real[i]; });
    }
    states[channel].pair_real = gather([&](std::size_t lane) { return of(lane).pair_real; });
    states[channel].pair_imaginary =
        gather([&](std::size_t lane) { return of(lane).pair_imaginary; });
  }
}

HWY_INLINE void scatter(const SignalSums<Batch>& sums,
                        std::span<SignalSums<double>, batch_lanes> result) {
  for (std::size_t s = 0; s < num_signals; ++s) {
    for (std::size_t i = 0; i < 2 * num_fit_lines_max; ++i) {
      alignas(64) double values[batch_lanes];
      for (std::size_t part = 0; part < num_vectors; ++part) {
        hn::Store(sums[s][i].part[part], Doubles(), values + part * width);
      }
      for (std::size_t lane = 0; lane < batch_lanes; ++lane) result[lane][s][i] = values[lane];
    }
  }
}

}  // namespace

#define PROOFMASS_JOIN(a, b) a##b
#define PROOFMASS_NAME(stem, set) PROOFMASS_JOIN(stem, set)

void PROOFMASS_NAME(record_batch_,
                    PROOFMASS_KERNEL_SET)(const BatchSession& session,
                                          std::span<SignalSums<double>, batch_lanes> sums) {
  BatchNoise noise(session);
  gather_states(session, noise.states());
  const LoopConstants<Batch> constants = gather_constants(session);
  const auto progress = [&](std::size_t num_samples) {
    session.progress(session.progress_context, num_samples);
  };
  scatter(record_session<Batch>(*session.signals, session.setup, constants, noise,
                                session.weights_buffer, progress),
          sums);
}

double PROOFMASS_NAME(make_noise_, PROOFMASS_KERNEL_SET)(const BatchSession& session,
                                                         std::size_t num_samples, NoiseWork work) {
  BatchNoise noise(session);
  gather_states(session, noise.states());
  Batch sum;
  for (std::size_t k = 0; k < num_samples; ++k) {
    if (work == NoiseWork::deviates) {
      sum = sum + noise.next_deviate();
      continue;
    }
    const SampleNoise<Batch> sample = noise.next();
    const Vector3<Batch> total = sample.sensor[0] + sample.sensor[1] + sample.angular +
                                 sample.star_tracker + sample.thrust + sample.torque;
    sum = sum + total.x + total.y + total.z;
  }
  alignas(64) double values[batch_lanes];
  double result = 0.0;
  for (std::size_t i = 0; i < num_vectors; ++i) {
    hn::Store(sum.part[i], Doubles(), values + i * width);
  }
  for (const double value : values) result += value;
  return result;
}

#undef PROOFMASS_NAME
#undef PROOFMASS_JOIN

}  // namespace proofmass
