#include "core/random/stream.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

constexpr long double root_2 = std::numbers::sqrt2_v<long double>;

/// Φ(x) − p by whichever tail or half of the law keeps its digits.
long double excess(long double x, double p) {
  const long double probability = p;
  if (p < 0.25) return 0.5L * std::erfc(-x / root_2) - probability;
  if (p > 0.75) return (1.0L - probability) - 0.5L * std::erfc(x / root_2);
  return 0.5L * std::erf(x / root_2) - (probability - 0.5L);
}

/// Relative error of inverse_normal(p), p ≠ ½: (Φ(x) − p)/(φ(x)·x), the Newton step to the root.
double relative_error(double p) {
  const long double x = inverse_normal(p);
  const long double density =
      std::exp(-0.5L * x * x) / std::sqrt(2.0L * std::numbers::pi_v<long double>);
  return static_cast<double>(std::fabs(excess(x, p) / (density * x)));
}

/// Probabilities of uniform() and, on the lower side, down to the smallest normal number.
std::vector<double> probabilities() {
  std::mt19937_64 bits(241);
  std::vector<double> values;
  for (int i = 0; i < 300'000; ++i) {
    values.push_back((static_cast<double>(bits() >> 12) + 0.5) * 0x1p-52);
    const double deep = std::ldexp(values.back(), -(i % 1000));
    values.push_back(deep);
    if (i % 1000 < 40) values.push_back(1.0 - deep);
  }
  for (const double edge : {0.075, 0.925, std::exp(-25.0)}) {
    for (const double p : {edge, std::nextafter(edge, 0.0), std::nextafter(edge, 1.0)}) {
      values.push_back(p);
    }
  }
  values.push_back(0x1p-53);
  values.push_back(1.0 - 0x1p-53);
  values.push_back(std::numeric_limits<double>::min());
  return values;
}

// The approximation's own error is 1e-16; measured with its roundings: 8.7e-16 at worst.
TEST(InverseNormal, IsWithin1e15OfTheInverseOfTheLaw) {
  double worst = 0.0;
  for (const double p : probabilities()) {
    if (p != 0.5) worst = std::fmax(worst, relative_error(p));
  }
  EXPECT_LT(worst, 1e-15);
  EXPECT_EQ(inverse_normal(0.5), 0.0);
}

TEST(InverseNormal, IsOddAboutOneHalf) {
  std::mt19937_64 bits(242);
  for (int i = 0; i < 100'000; ++i) {
    const double p = (static_cast<double>(bits() >> 12) + 0.5) * 0x1p-52;
    ASSERT_EQ(inverse_normal(1.0 - p), -inverse_normal(p)) << p;  // 1 − p is exact.
  }
}

// Neighbouring values of uniform() lie far enough apart for rounding not to turn their order;
// neighbouring doubles do not.
TEST(InverseNormal, IsMonotoneOnTheGridOfUniform) {
  for (const double near : {1e-12, 1e-6, 0.01, 0.075, 0.3, 0.45, 0.7, 0.925, 0.999999}) {
    const double first = std::floor(near * 0x1p52) - 10'000.0;
    double previous = -std::numeric_limits<double>::infinity();
    for (int i = near < 1e-9 ? 10'000 : 0; i < 30'000; ++i) {
      const double next = inverse_normal((first + i + 0.5) * 0x1p-52);
      ASSERT_GE(next, previous) << near << " at step " << i;
      previous = next;
    }
  }
}

TEST(InverseNormalDeathTest, RefusesWhatIsNoProbability) {
  EXPECT_DEATH(static_cast<void>(inverse_normal(0.0)), "probability > 0.0");
  EXPECT_DEATH(static_cast<void>(inverse_normal(1.0)), "probability < 1.0");
}

}  // namespace
}  // namespace proofmass
