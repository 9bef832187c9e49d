#include "core/random/normal_deviates.hpp"
#include "core/random/stream.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

constexpr long double two_pi = 2.0L * std::numbers::pi_v<long double>;

/// The uniform number that a radius comes from, on the grid that a float resolves.
long double radius_uniform(std::uint32_t word) {
  return (static_cast<float>(word >> 1) + 0.5F) * 0x1p-31F;
}

struct LongPair {
  long double radius, first, second;
};

LongPair reference_pair(std::uint32_t radius_word, std::uint32_t angle_word) {
  const long double radius = std::sqrt(-2.0L * std::log(radius_uniform(radius_word)));
  const long double angle = two_pi * std::ldexp(static_cast<long double>(angle_word), -32);
  return {radius, radius * std::cos(angle), radius * std::sin(angle)};
}

/// Largest error of the two deviates, as a part of their radius.
double relative_error(std::uint32_t radius_word, std::uint32_t angle_word) {
  const LongPair expected = reference_pair(radius_word, angle_word);
  const std::array<float, 4> actual =
      normal_deviates({radius_word, angle_word, radius_word, angle_word});
  EXPECT_EQ(actual[0], actual[2]);
  EXPECT_EQ(actual[1], actual[3]);
  const long double error =
      std::fmax(std::fabs(actual[0] - expected.first), std::fabs(actual[1] - expected.second));
  if (expected.radius == 0.0L) return static_cast<double>(error);
  return static_cast<double>(error / expected.radius);
}

// ln within 2 units in the last place gives the radius 1.2e-7, its root 0.6e-7, sine or
// cosine 1.2e-7 and the product 0.6e-7. These worst cases do not meet: 1.92e-7 is the largest that
// was measured.
constexpr double relative_error_max = 2.2e-7;

TEST(NormalDeviates, FollowTheClosedFormInSinglePrecision) {
  const RandomStream stream(5, RunIndex{0}, stream_id("words"));
  double worst = 0.0;
  for (std::uint32_t i = 0; i < 1'000'000; ++i) {
    const RandomBlock words = stream.block(i);
    worst = std::fmax(worst, relative_error(words[0], words[1]));
    // Small uniform numbers, and ones close to 1, are rare among random words.
    worst = std::fmax(worst, relative_error(words[2] >> (i % 32), words[3]));
    worst = std::fmax(worst, relative_error(~(words[2] >> (i % 32)), words[3]));
  }
  EXPECT_LT(worst, relative_error_max);
}

TEST(NormalDeviates, FollowTheClosedFormAtTheEdgesOfQuadrants) {
  for (std::uint32_t eighth = 0; eighth < 8; ++eighth) {
    for (const std::uint32_t offset : {0U, 1U, 64U, 0xffffffffU, 0xffffffc0U}) {
      EXPECT_LT(relative_error(0x12345678, (eighth << 29) + offset), relative_error_max);
    }
  }
}

/// Mean relative error, with its sign, of one of the two deviates over words that move in small
/// ranges.
double mean_error(std::uint32_t radius_word, std::uint32_t angle_word, std::size_t component) {
  constexpr std::uint32_t num_words = 100'000;
  double sum = 0.0;
  for (std::uint32_t i = 0; i < num_words; ++i) {
    const std::uint32_t radius = radius_word + 499 * i;
    const std::uint32_t angle = angle_word + 997 * i;
    const LongPair pair = reference_pair(radius, angle);
    const long double expected = component == 0 ? pair.first : pair.second;
    sum += static_cast<double>(normal_deviates({radius, angle, 0, 0})[component] / expected - 1.0L);
  }
  return sum / num_words;
}

// Where its series ends a function errs to one side: next to √½ for the logarithm's mantissa, next
// to an eighth of a turn for sine and cosine. Roundings of coefficients leave up to 3e-8, half a
// unit in the last place; a term fewer would leave 6e-8 and more.
TEST(NormalDeviates, AreNotBiasedWhereTheirSeriesEnd) {
  constexpr std::uint32_t above_half_root = 0xb504f400;  // u = √½
  constexpr std::uint32_t below_half_root = above_half_root - 50'000'000;
  constexpr std::uint32_t some_angle = 0x0d000000;
  constexpr std::uint32_t before_eighth = 0x20000000 - 100'000'000;
  constexpr std::uint32_t some_radius = 0x30000000;
  for (const std::size_t component : {0U, 1U}) {
    EXPECT_NEAR(mean_error(above_half_root, some_angle, component), 0.0, 4e-8) << component;
    EXPECT_NEAR(mean_error(below_half_root, some_angle, component), 0.0, 4e-8) << component;
    EXPECT_NEAR(mean_error(some_radius, before_eighth, component), 0.0, 4e-8) << component;
  }
}

TEST(NormalDeviates, AreFiniteAndWithin666) {
  double largest = 0.0;
  for (const std::uint32_t radius : {0U, 1U, 2U, 0x7fffffffU, 0xfffffffeU, 0xffffffffU}) {
    for (std::uint32_t i = 0; i < 4096; ++i) {
      for (const float deviate : normal_deviates({radius, i << 20, radius, ~(i << 20)})) {
        ASSERT_TRUE(std::isfinite(deviate));
        largest = std::fmax(largest, std::fabs(static_cast<double>(deviate)));
      }
    }
  }
  // √(−2 ln 2⁻³²) = 8√(ln 2)
  EXPECT_NEAR(largest, 8.0 * std::sqrt(std::numbers::ln2), 1e-6);
  EXPECT_LE(largest, 6.6605);
}

}  // namespace
}  // namespace proofmass
