#include "core/math/elementary.hpp"

#include <Eigen/Dense>

#include "core/math/hash.hpp"
#include "core/math/vector3.hpp"
#include "tests/test.hpp"

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

/// Numbers in [-1, 1) from a generator whose output the standard fixes.
class RandomNumbers {
 public:
  double operator()() { return static_cast<double>(bits_() >> 11) * 0x1p-52 - 1.0; }
  Vector3<double> vector() {
    const double x = (*this)();
    const double y = (*this)();
    const double z = (*this)();
    return {x, y, z};
  }
  Quaternion<double> rotation() {
    const Vector3<double> v = vector();
    const double s = (*this)();
    const double length = std::sqrt(s * s + dot(v, v));
    return {s / length, (1.0 / length) * v};
  }

 private:
  std::mt19937_64 bits_{417};
};

Eigen::Vector3d eigen(const Vector3<double>& v) { return {v.x, v.y, v.z}; }

/// R_AB of q_AB from the textbook's nine entries; v_A = R_AB v_B.
Eigen::Matrix3d matrix_of(const Quaternion<double>& q) {
  const double w = q.scalar;
  const auto& [x, y, z] = q.vector;
  Eigen::Matrix3d m;
  m << 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),  //
      2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),   //
      2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y);
  return m;
}

double distance(const Quaternion<double>& a, const Quaternion<double>& b) {
  const Vector3<double> d = a.vector - b.vector;
  return std::sqrt((a.scalar - b.scalar) * (a.scalar - b.scalar) + dot(d, d));
}

// A quarter turn about Z from A to B carries X_A into −Y_B.
TEST(Quaternion, TurnsComponentsOfTheFirstFrameIntoTheSecond) {
  const double half_root = std::sqrt(0.5);
  const Quaternion<double> q_AB{half_root, {0.0, 0.0, half_root}};
  const Vector3<double> v_B = to_target(q_AB, Vector3<double>{1.0, 0.0, 0.0});
  EXPECT_NEAR(v_B.x, 0.0, 1e-15);
  EXPECT_NEAR(v_B.y, -1.0, 1e-15);
  EXPECT_NEAR(v_B.z, 0.0, 1e-15);
}

// Some ten roundings of numbers of order one: 1e-15.
TEST(Quaternion, ToTargetIsTheTransposedMatrix) {
  RandomNumbers random;
  for (int i = 0; i < 1000; ++i) {
    const Quaternion<double> q = random.rotation();
    const Vector3<double> v = random.vector();
    const Eigen::Vector3d expected = matrix_of(q).transpose() * eigen(v);
    EXPECT_LT((eigen(to_target(q, v)) - expected).norm(), 2e-15);
  }
}

TEST(Quaternion, ProductIsTheProductOfMatrices) {
  RandomNumbers random;
  for (int i = 0; i < 1000; ++i) {
    const Quaternion<double> q_AB = random.rotation();
    const Quaternion<double> q_BC = random.rotation();
    const Eigen::Matrix3d expected = matrix_of(q_AB) * matrix_of(q_BC);
    EXPECT_LT((matrix_of(q_AB * q_BC) - expected).norm(), 5e-15);
  }
}

TEST(Quaternion, ConjugateTurnsBack) {
  RandomNumbers random;
  for (int i = 0; i < 1000; ++i) {
    const Quaternion<double> a = random.rotation();
    const Quaternion<double> b = random.rotation();
    const Vector3<double> v = random.vector();
    EXPECT_LT(distance(a * conjugate(a), Quaternion<double>{}), 1e-15);
    EXPECT_LT(distance(conjugate(a * b), conjugate(b) * conjugate(a)), 1e-15);
    EXPECT_LT((eigen(to_target(conjugate(a), to_target(a, v))) - eigen(v)).norm(), 3e-15);
  }
}

struct RotationError {
  double scalar, vector;
};

/// Errors of rotation_by() against cosine and sine of half the angle in long double.
RotationError rotation_error(double angle, const Vector3<double>& axis) {
  const Vector3<double> rotation = angle * axis;
  const Quaternion<double> actual = rotation_by(rotation);
  const long double x = rotation.x;
  const long double y = rotation.y;
  const long double z = rotation.z;
  const long double length = std::sqrt(x * x + y * y + z * z);
  const long double part = length == 0.0L ? 0.5L : std::sin(0.5L * length) / length;
  const long double vector = std::fmax(
      std::fabs(actual.vector.x - part * x),
      std::fmax(std::fabs(actual.vector.y - part * y), std::fabs(actual.vector.z - part * z)));
  return {static_cast<double>(std::fabs(actual.scalar - std::cos(0.5L * length))),
          static_cast<double>(vector)};
}

RotationError worst_rotation_error(double angle_max) {
  RandomNumbers random;
  RotationError worst = rotation_error(angle_max, {0.6, 0.0, 0.8});
  for (int i = 0; i < 20000; ++i) {
    const Vector3<double> v = random.vector();
    const Vector3<double> axis = (1.0 / std::sqrt(dot(v, v))) * v;
    const RotationError error = rotation_error(angle_max * std::fabs(random()), axis);
    worst = {std::fmax(worst.scalar, error.scalar), std::fmax(worst.vector, error.vector)};
  }
  return worst;
}

// The cosine's series ends before (angle/2)⁸/8!: 9.7e-16 at 0.1 rad, 4e-18 at 0.05 rad, beside the
// rounding of a number just below 1 (0.6e-16 to store it, as much to compute it).
TEST(RotationBy, HasTheCosineOfHalfTheAngle) {
  EXPECT_LT(worst_rotation_error(0.1).scalar, 9.7e-16 + 1.2e-16);
  EXPECT_LT(worst_rotation_error(0.05).scalar, 1.2e-16);
  EXPECT_LT(worst_rotation_error(1e-3).scalar, 1.2e-16);
  EXPECT_EQ(rotation_error(0.0, {1.0, 0.0, 0.0}).scalar, 0.0);
}

// The sine's series ends before (angle/2)⁹/9! = 5e-18; three roundings of a component of 0.05 are
// 1e-17.
TEST(RotationBy, HasTheSineOfHalfTheAngleAlongItsAxis) {
  EXPECT_LT(worst_rotation_error(0.1).vector, 1.6e-17);
  EXPECT_LT(worst_rotation_error(1e-3).vector, 1.6e-19);
  EXPECT_EQ(rotation_error(0.0, {1.0, 0.0, 0.0}).vector, 0.0);
}

TEST(ErrorAngles, AreInvertedByFromErrorAngles) {
  RandomNumbers random;
  for (int i = 0; i < 1000; ++i) {
    const Vector3<double> angles = 0.05 * random.vector();
    const Quaternion<double> q = from_error_angles(angles);
    EXPECT_NEAR(q.scalar * q.scalar + dot(q.vector, q.vector), 1.0, 4e-16);
    const Vector3<double> back = error_angles(q);
    EXPECT_EQ(back.x, angles.x);  // Halving and doubling are exact.
    EXPECT_EQ(back.y, angles.y);
    EXPECT_EQ(back.z, angles.z);
  }
}

TEST(Normalised, SquaresTheDefectOfLength) {
  constexpr double defect = 1e-5;
  const Quaternion<double> q{0.6 * (1.0 + defect), {0.0, 0.8 * (1.0 + defect), 0.0}};
  const Quaternion<double> unit = normalised(q);
  const double length = std::sqrt(unit.scalar * unit.scalar + dot(unit.vector, unit.vector));
  // (1 + d)(1 − d − ½d²) = 1 − (3/2)d² + O(d³)
  EXPECT_NEAR(length - 1.0, -1.5 * defect * defect, 2.0 * defect * defect * defect + 2.3e-16);
}

TEST(Vector3, CrossAndMatrixProductsFollowEigen) {
  RandomNumbers random;
  for (int i = 0; i < 100; ++i) {
    const Vector3<double> a = random.vector();
    const Vector3<double> b = random.vector();
    const Vector3<double> c = random.vector();
    const Vector3<double> v = random.vector();
    Eigen::Matrix3d m;
    m << eigen(a).transpose(), eigen(b).transpose(), eigen(c).transpose();
    EXPECT_LT((eigen(cross(a, b)) - eigen(a).cross(eigen(b))).norm(), 1e-15);
    EXPECT_LT((eigen(Matrix3<double>{{a, b, c}} * v) - m * eigen(v)).norm(), 2e-15);
  }
}

// Test vectors of RFC 9923, appendix C.
TEST(Fnv1a, IsThatOfTheStandard) {
  EXPECT_EQ(fnv1a(""), 0xcbf29ce484222325U);
  EXPECT_EQ(fnv1a("a"), 0xaf63dc4c8601ec8cU);
  EXPECT_EQ(fnv1a("foobar"), 0x85944171f73967e8U);
}

// The first three outputs of SplitMix64 with seed 1234567, whose state grows by the constant.
TEST(Mixed, IsTheOutputOfSplitMix64) {
  constexpr std::uint64_t increment = 0x9e3779b97f4a7c15;
  EXPECT_EQ(mixed(1234567), 6457827717110365317U);
  EXPECT_EQ(mixed(1234567 + increment), 3203168211198807973U);
  EXPECT_EQ(mixed(1234567 + 2 * increment), 9817491932198370423U);
}

TEST(FractionOf, IsBelowOne) {
  EXPECT_EQ(fraction_of(0), 0.0);
  EXPECT_EQ(fraction_of(std::uint64_t{1} << 63), 0.5);
  EXPECT_LT(fraction_of(~std::uint64_t{0}), 1.0);
}

}  // namespace
}  // namespace proofmass
