#pragma once

// The number type of a kernel; see batch_kernel-inl.hpp.

#include <hwy/highway.h>

#include <cstddef>
#include <cstdint>

#include "core/microscope/simulation/run.hpp"

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
constexpr std::size_t num_vectors = PROOFMASS_KERNEL_VECTORS;  ///< Of doubles: 1 or 2.
constexpr std::size_t num_lanes = num_vectors * width;         ///< Runs of a group.
constexpr std::size_t num_groups = batch_lanes / num_lanes;
static_assert(batch_lanes % num_lanes == 0);
static_assert(num_vectors == 1 || num_vectors == 2);

/// One double of each run of a group.
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
HWY_INLINE Batch operator/(const Batch& a, const Batch& b) {
  return map(a, b, [](V x, V y) HWY_ATTR { return hn::Div(x, y); });
}
HWY_INLINE Batch operator-(const Batch& a) {
  return map(a, [](V x) HWY_ATTR { return hn::Neg(x); });
}
HWY_INLINE Batch square_root(const Batch& a) {
  return map(a, [](V x) HWY_ATTR { return hn::Sqrt(x); });
}

HWY_INLINE Batch magnitude(const Batch& a) {
  return map(a, [](V x) HWY_ATTR { return hn::Abs(x); });
}
#if HWY_ARCH_ARM
// The instructions for the larger and the smaller of two numbers yield the first operand if the
// second is not a number, which the functions of core/math/vector3.hpp do not.
HWY_INLINE Batch larger(const Batch& a, const Batch& b) {
  return map(a, b, [](V x, V y) HWY_ATTR { return hn::IfThenElse(hn::Gt(x, y), x, y); });
}
HWY_INLINE Batch smaller(const Batch& a, const Batch& b) {
  return map(a, b, [](V x, V y) HWY_ATTR { return hn::IfThenElse(hn::Lt(x, y), x, y); });
}
#else
// The instructions yield the second operand if either is not a number, as the functions of
// core/math/vector3.hpp do.
HWY_INLINE Batch larger(const Batch& a, const Batch& b) {
  return map(a, b, [](V x, V y) HWY_ATTR { return hn::Max(x, y); });
}
HWY_INLINE Batch smaller(const Batch& a, const Batch& b) {
  return map(a, b, [](V x, V y) HWY_ATTR { return hn::Min(x, y); });
}
#endif
HWY_INLINE bool is_any_above(const Batch& a, double limit) {
  auto above = hn::Gt(a.part[0], hn::Set(Doubles(), limit));
  for (std::size_t i = 1; i < num_vectors; ++i) {
    above = hn::Or(above, hn::Gt(a.part[i], hn::Set(Doubles(), limit)));
  }
  return !hn::AllFalse(Doubles(), above);
}

HWY_INLINE Batch limit_where_above(const Batch& a, double limit) {
  return map(a, [limit](V x) HWY_ATTR {
    const V top = hn::Set(Doubles(), limit);
    return hn::IfThenElse(hn::Gt(x, top), top, hn::Inf(Doubles()));
  });
}

}  // namespace
}  // namespace proofmass
