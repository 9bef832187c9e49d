#include "core/microscope/control/margins.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/math/elementary.hpp"

namespace proofmass {
namespace {

constexpr double pi = std::numbers::pi;
constexpr double first_angle = 2e-8 * pi;
constexpr int num_angles = 4000;  // 500 a decade: L turns by some degrees from one to the next.

double grid_angle(int i) {
  if (i == num_angles) return pi;
  return first_angle * exponential(logarithm(pi / first_angle) * i / num_angles);
}

ComplexDouble at(const OpenLoop& loop, double angle, double radius = 1.0) {
  const SineCosine turn = sincos(angle);
  return loop({turn.cosine / radius, -turn.sine / radius});
}

/// Where a function that changes its sign does so; the higher end if it does not.
template <typename Function>
double root(const Function& function, double low, double high) {
  const bool is_low_positive = function(low) > 0.0;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    ((function(middle) > 0.0) == is_low_positive ? low : high) = middle;
  }
  return high;
}

/// Middle of a number's quadrant, in quarters of a turn.
double quadrant(ComplexDouble number) {
  if (number.imag() >= 0.0) return number.real() >= 0.0 ? 0.5 : 1.5;
  return number.real() < 0.0 ? 2.5 : 3.5;
}

/// Along half of the circle, of which the other half is the mirror image, 1 + L begins and ends on
/// the real axis. A zero outside makes it turn by half a turn at least.
bool is_stable(const OpenLoop& loop) {
  constexpr double radius = 1.0 + 1e-6;
  const auto on_axis = [&](double angle) {
    return 1.0 + at(loop, angle, radius).real() >= 0.0 ? 0.0 : 2.0;
  };
  double last = on_axis(0.0), num_quarters = 0.0;
  const auto turn_to = [&](double next) {
    const double step = next - last;  // A quarter at most, or the same less or more a whole turn.
    num_quarters += step - 4.0 * std::round(step / 4.0);
    last = next;
  };
  for (int i = 0; i < num_angles; ++i) turn_to(quadrant(1.0 + at(loop, grid_angle(i), radius)));
  turn_to(on_axis(pi));
  return num_quarters == 0.0;
}

}  // namespace

Margins margins_of(const OpenLoop& open_loop) {
  if (!is_stable(open_loop)) return {};
  const auto excess = [&](double angle) { return norm(at(open_loop, angle)) - 1.0; };
  const auto height = [&](double angle) { return at(open_loop, angle).imag(); };
  Margins margins{std::numeric_limits<double>::infinity(), pi};
  for (int i = 0; i < num_angles; ++i) {
    const double low = grid_angle(i), high = grid_angle(i + 1);
    if ((excess(low) > 0.0) != (excess(high) > 0.0)) {
      const double there = at(open_loop, root(excess, low, high)).real();
      // |L| is 1, so −L has the cosine −Re L.
      const auto above = [&](double phase) { return sincos(phase).cosine + there; };
      margins.phase_rad = std::min(margins.phase_rad, root(above, 0.0, pi));
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
