// What squares make of a push, against the exact inverse of a sensor's parabola.

#include <cmath>
#include <complex>
#include <numbers>

#include "core/microscope/estimation/joint/joint_model.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

using Complex = std::complex<double>;

/// Line at the frequency of the first of f(δ), where m = δ + K δ² is the sum of two cosines.
template <typename Function>
Complex line_of_push(double amplitude, double other_amplitude, double k, const Function& f) {
  constexpr int num_samples = 1024;
  Complex sum;
  for (int i = 0; i < num_samples; ++i) {
    const double turn = 2.0 * std::numbers::pi * i / num_samples;
    const double m = amplitude * std::cos(31.0 * turn) + other_amplitude * std::cos(101.0 * turn);
    const double value = f((std::sqrt(1.0 + 4.0 * k * m) - 1.0) / (2.0 * k));
    sum += value * Complex(std::cos(31.0 * turn), std::sin(31.0 * turn));
  }
  return 2.0 / num_samples * sum;
}

// The bounds are the next terms of the series:
// of δ², −132 K⁵m⁷ with 35/64 at the line; of two pushes, −14 K³m⁵; of δ, 14 K⁴m⁵ with 5/8. The
// terms after them are some hundredths of these, as K m is 1/20.
TEST(JointModel, HasTheHigherOrdersOfAPush) {
  constexpr double k = 1e4, k2d = 5e3, a = 5e-6;
  UnknownArray unknowns{};
  unknowns[index(Parameter::k2c)] = k;
  unknowns[index(Parameter::k2d)] = k2d;
  unknowns[index(Parameter::a_d12)] = unknowns[index(Parameter::a_d13)] = 1e-3;
  unknowns[index(Unknown::square_y)] = unknowns[index(Unknown::square_z)] = k * k;
  const auto terms = [&](const Push& push) {
    return push_terms(DragFreeSource::common, unknowns, push, PushLine::at_f).value;
  };
  const auto squared = [](double x) { return k2d * x * x; };
  const double part = k * a;
  const Complex along_x = line_of_push(a, 0.0, k, squared);
  EXPECT_LT(std::abs(terms({.axis = Axis::x, .at_f = a}) - along_x),
            1.1 * 132.0 * 35.0 / 64.0 * k2d / k * std::pow(part, 6) * a);
  const double small = 0.02 * a;
  const Complex beside = line_of_push(small, 2.0 * small, k, squared);
  EXPECT_LT(
      std::abs(
          terms({.axis = Axis::x, .at_f = small, .square_of_others_m2_s4 = 4.0 * small * small}) -
          beside),
      14.0 * k2d / k * std::pow(3.0 * k * small, 4) * 3.0 * small);
  const Complex along_y = line_of_push(a, 0.0, k, [](double x) { return 1e-3 * x; });
  for (const Axis axis : {Axis::y, Axis::z}) {
    EXPECT_LT(std::abs(1e-3 * a + terms({.axis = axis, .at_f = a}) - along_y),
              1.1 * 14.0 * 5.0 / 8.0 * 1e-3 * std::pow(part, 4) * a);
  }
}

}  // namespace
}  // namespace proofmass
