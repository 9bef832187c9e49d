#include "core/microscope/control/margins.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

namespace proofmass {
namespace {

using Complex = std::complex<double>;

constexpr double pi = std::numbers::pi;
constexpr double first_angle = 2e-8 * pi;
constexpr int num_angles = 4000;  // 500 a decade: L turns by some degrees from one to the next.

double angle(int i) { return first_angle * std::pow(pi / first_angle, double(i) / num_angles); }

Complex at(const OpenLoop& loop, double angle, double radius = 1.0) {
  return loop(std::polar(1.0 / radius, -angle));
}

/// Where a function of the angle that changes its sign is 0.
template <typename Function>
double root(const Function& function, double low, double high) {
  const bool is_low_positive = function(low) > 0.0;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    ((function(middle) > 0.0) == is_low_positive ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

/// Half of the turns of 1 + L about 0 along the circle, in radians: the other half is its mirror
/// image. It begins on the real axis.
bool is_stable(const OpenLoop& loop) {
  constexpr double radius = 1.0 + 1e-6;
  Complex last = 1.0 + at(loop, 0.0, radius);
  double turned = 0.0;
  for (int i = 0; i <= num_angles; ++i) {
    const Complex next = 1.0 + at(loop, angle(i), radius);
    turned += std::arg(next / last);
    last = next;
  }
  return std::abs(turned) < 0.5 * pi;
}

}  // namespace

Margins margins_of(const OpenLoop& open_loop) {
  if (!is_stable(open_loop)) return {};
  const auto size = [&](double at_angle) { return std::abs(at(open_loop, at_angle)) - 1.0; };
  const auto height = [&](double at_angle) { return at(open_loop, at_angle).imag(); };
  Margins margins{std::numeric_limits<double>::infinity(), pi};
  for (int i = 0; i < num_angles; ++i) {
    const double low = angle(i), high = angle(i + 1);
    if ((size(low) > 0.0) != (size(high) > 0.0)) {
      const Complex there = at(open_loop, root(size, low, high));
      margins.phase_rad = std::min(margins.phase_rad, std::abs(std::arg(-there)));
    }
    // At half the sample rate L is real: its phase reaches the axis there, or crosses it before.
    if ((height(low) > 0.0) != (height(high) > 0.0) || i + 1 == num_angles) {
      const double there = at(open_loop, root(height, low, high)).real();
      if (there > -1.0 && there < 0.0) margins.gain = std::min(margins.gain, -1.0 / there);
    }
  }
  return margins;
}

}  // namespace proofmass
