#include "core/math/elementary.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

namespace proofmass {
namespace {

// The references are the C library's in 64-bit mantissas: their own error is below 1e-19.
constexpr long double two_pi = 2.0L * std::numbers::pi_v<long double>;

/// Arguments of both signs spread evenly over [-limit, limit] and over the powers of two below it.
std::vector<double> wide_arguments(double limit, int num_powers) {
  std::mt19937_64 bits(20130917);
  const auto part = [&bits] { return static_cast<double>(bits() >> 11) * 0x1p-53; };
  std::vector<double> arguments;
  for (int i = 0; i < 300'000; ++i) {
    const double even = limit * (2.0 * part() - 1.0);
    arguments.push_back(even);
    arguments.push_back(std::ldexp(even, -(i % num_powers)));
  }
  return arguments;
}

/// Neighbours of the places where sincos_turns() changes its polynomial or its quadrant.
std::vector<double> eighths_and_their_neighbours() {
  std::vector<double> arguments{0.0, -0.0, std::numeric_limits<double>::denorm_min()};
  for (int eighth = -40; eighth <= 40; ++eighth) {
    const double turns = 0.125 * eighth;
    for (const double to : {-10.0, 10.0}) arguments.push_back(std::nextafter(turns, to));
    arguments.push_back(turns);
  }
  return arguments;
}

struct LongSineCosine {
  long double sine, cosine;
};

LongSineCosine reference_of_turns(double turns) {
  const long double x = turns;
  const long double rest = x - std::nearbyint(x);  // Exact.
  return {std::sin(two_pi * rest), std::cos(two_pi * rest)};
}

double error_of_turns(double turns) {
  const SineCosine actual = sincos_turns(turns);
  const LongSineCosine expected = reference_of_turns(turns);
  return static_cast<double>(std::fmax(std::fabs(actual.sine - expected.sine),
                                       std::fabs(actual.cosine - expected.cosine)));
}

// Measured: 1.7e-16 at worst.
TEST(SinCosTurns, IsWithin3e16OverTheWholeRange) {
  double worst = 0.0;
  for (const double turns : wide_arguments(4.0, 60))
    worst = std::fmax(worst, error_of_turns(turns));
  for (const double turns : wide_arguments(0x1p48, 110)) {
    worst = std::fmax(worst, error_of_turns(turns));
  }
  for (const double turns : eighths_and_their_neighbours()) {
    worst = std::fmax(worst, error_of_turns(turns));
  }
  EXPECT_LT(worst, 3e-16);
}

// A whole number of quarters must not leak 1e-16 of the other component into an exact zero.
TEST(SinCosTurns, IsExactAtQuarters) {
  const double large = 0x1p40;
  for (const double whole : {-large, -3.0, 0.0, 1.0, large}) {
    EXPECT_EQ(sincos_turns(whole).sine, 0.0);
    EXPECT_EQ(sincos_turns(whole).cosine, 1.0);
    EXPECT_EQ(sincos_turns(whole + 0.25).sine, 1.0);
    EXPECT_EQ(sincos_turns(whole + 0.25).cosine, 0.0);
    EXPECT_EQ(sincos_turns(whole + 0.5).sine, 0.0);
    EXPECT_EQ(sincos_turns(whole + 0.5).cosine, -1.0);
    EXPECT_EQ(sincos_turns(whole + 0.75).sine, -1.0);
    EXPECT_EQ(sincos_turns(whole + 0.75).cosine, 0.0);
  }
}

// Small angles: sin x keeps its relative accuracy. 2π in double and the product each round once
// (0.4 and 1.1e-16), the series twice. Measured: 3.0e-16 at worst.
TEST(SinCosTurns, KeepsTheRelativeAccuracyOfSmallSines) {
  double worst = 0.0;
  for (const double turns : wide_arguments(0.125, 1000)) {
    if (turns == 0.0) continue;
    const long double expected = reference_of_turns(turns).sine;
    const long double error = (sincos_turns(turns).sine - expected) / expected;
    worst = std::fmax(worst, static_cast<double>(std::fabs(error)));
  }
  EXPECT_LT(worst, 4e-16);
}

// Two roundings of the angle in turns, of 2π in double (3.9e-17) and of the quotient (1.1e-16),
// make a phase error of 1.5e-16·|angle|.
TEST(SinCos, ErrorGrowsAsTheAngleTimesOneRounding) {
  for (const double limit : {1.0, 100.0, 1e6, 1e12}) {
    double worst = 0.0;
    for (const double angle : wide_arguments(limit, 60)) {
      const SineCosine actual = sincos(angle);
      const long double sine = std::sin(static_cast<long double>(angle));
      const long double cosine = std::cos(static_cast<long double>(angle));
      const auto error = static_cast<double>(
          std::fmax(std::fabs(actual.sine - sine), std::fabs(actual.cosine - cosine)));
      worst = std::fmax(worst, error / (3e-16 + 1.5e-16 * std::fabs(angle)));
    }
    EXPECT_LT(worst, 1.0) << "angles up to " << limit;
  }
}

double relative_error_of_exponential(double x) {
  const long double expected = std::exp(static_cast<long double>(x));
  return static_cast<double>(std::fabs((exponential(x) - expected) / expected));
}

// Measured: 1.7e-16 at worst.
TEST(Exponential, IsWithin4e16FromMinus700To700) {
  double worst = 0.0;
  for (const double x : wide_arguments(700.0, 70)) {
    worst = std::fmax(worst, relative_error_of_exponential(x));
  }
  // Where the number of factors 2 changes.
  for (int k = -1000; k <= 1000; ++k) {
    const double edge = (k + 0.5) * std::numbers::ln2;
    for (const double x : {edge, std::nextafter(edge, 1e3), std::nextafter(edge, -1e3)}) {
      worst = std::fmax(worst, relative_error_of_exponential(x));
    }
  }
  EXPECT_LT(worst, 4e-16);
  EXPECT_EQ(exponential(0.0), 1.0);
}

double scaled_error_of_logarithm(double x) {
  const long double expected = std::log(static_cast<long double>(x));
  const long double scale = std::fmax(std::fabs(expected), 0.5L);
  return static_cast<double>(std::fabs(logarithm(x) - expected) / scale);
}

// Measured: 2.9e-16 at worst.
TEST(Logarithm, IsWithin4e16OfItsScaleForNormalNumbers) {
  std::mt19937_64 bits(20130918);
  double worst = 0.0;
  for (int i = 0; i < 600'000; ++i) {
    const std::uint64_t pattern = bits() & 0x7fffffffffffffffU;
    const auto x = std::bit_cast<double>(pattern);
    if (std::isnormal(x)) worst = std::fmax(worst, scaled_error_of_logarithm(x));
  }
  for (const double x : wide_arguments(1.0, 60)) {
    worst = std::fmax(worst, scaled_error_of_logarithm(1.0 + 0.5 * x));
  }
  for (const double edge : {std::numbers::sqrt2, std::numbers::sqrt2 / 2, 1.0, 2.0, 0.5}) {
    for (const double x : {edge, std::nextafter(edge, 3.0), std::nextafter(edge, 0.0)}) {
      worst = std::fmax(worst, scaled_error_of_logarithm(x));
    }
  }
  worst = std::fmax(worst, scaled_error_of_logarithm(std::numeric_limits<double>::min()));
  worst = std::fmax(worst, scaled_error_of_logarithm(std::numeric_limits<double>::max()));
  EXPECT_LT(worst, 4e-16);
}

// ln x ≈ x − 1 near 1: no cancellation may spoil it there. The quotient s, the series and their
// product round four times in all; measured: 4.3e-16 at worst.
TEST(Logarithm, KeepsItsRelativeAccuracyNearOne) {
  double worst = 0.0;
  for (const double x : wide_arguments(0.25, 45)) {
    const double argument = 1.0 + x;
    if (argument == 1.0) continue;
    const long double expected = std::log(static_cast<long double>(argument));
    worst = std::fmax(worst,
                      static_cast<double>(std::fabs((logarithm(argument) - expected) / expected)));
  }
  EXPECT_LT(worst, 5e-16);
  EXPECT_EQ(logarithm(1.0), 0.0);
}

}  // namespace
}  // namespace proofmass
