#include "core/microscope/control/margins.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>
#include <utility>
#include <vector>

#include "core/math/elementary.hpp"

namespace proofmass {
namespace {

constexpr double pi = std::numbers::pi;
constexpr double first_angle = 2e-8 * pi;
constexpr int num_angles = 16000;

ComplexDouble at(const OpenLoop& loop, const SineCosine& turn, double radius) {
  return loop({turn.cosine / radius, -turn.sine / radius});
}
ComplexDouble at(const OpenLoop& loop, double angle, double radius = 1.0) {
  return at(loop, sincos(angle), radius);
}

struct GridPoint {
  double angle;
  SineCosine turn;
};

/// From first_angle to π in equal ratios.
const std::vector<GridPoint>& grid() {
  static const std::vector<GridPoint> points = [] {
    std::vector<GridPoint> all;
    const double ratio = logarithm(pi / first_angle);
    for (int i = 0; i <= num_angles; ++i) {
      const double angle = i == num_angles ? pi : first_angle * exponential(ratio * i / num_angles);
      all.push_back({angle, sincos(angle)});
    }
    return all;
  }();
  return points;
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

/// Angles on both sides of a root, from an eighth of its distance from the circle to where the grid
/// is as fine.
void add_angles(ComplexDouble number, std::vector<GridPoint>& points) {
  const auto side = [&](double angle) {
    const auto [sine, cosine] = sincos(angle);
    return sine * number.real() - cosine * number.imag();
  };
  const double angle = root(side, 0.0, pi);
  const double distance = std::abs(1.0 - std::sqrt(norm(number)));
  for (double step = std::max(0.125 * distance, 1e-12); step < 1e-2 * angle; step *= 1.5) {
    for (const double near : {angle - step, angle + step}) {
      if (near > first_angle && near < pi) points.push_back({near, sincos(near)});
    }
  }
}

/// The grid, with the angles that an open loop's roots need.
std::vector<GridPoint> points_for(const Resonances& resonances) {
  std::vector<GridPoint> points = grid();
  for (const ComplexDouble pole : resonances.poles) add_angles(pole, points);
  for (const ComplexDouble zero : resonances.zeros) add_angles(zero, points);
  std::ranges::sort(points, {}, &GridPoint::angle);
  return points;
}

/// Middle of a number's quadrant, in quarters of a turn.
double quadrant(ComplexDouble number) {
  if (number.imag() >= 0.0) return number.real() >= 0.0 ? 0.5 : 1.5;
  return number.real() < 0.0 ? 2.5 : 3.5;
}

/// The turns of 1 + L about 0 along half of a circle, of which the other half is the mirror image.
class Winding {
 public:
  /// @param sum     1 + L, or what turns as often.
  /// @param points  The last one is π.
  Winding(const OpenLoop& sum, std::span<const GridPoint> points) : sum_(sum), points_(points) {}

  /// It begins and ends on the real axis. A zero outside makes it turn by half a turn at least.
  [[nodiscard]] bool is_none() {
    last_ = on_axis(0.0);
    double low = 0.0;
    for (const GridPoint& point : points_.first(points_.size() - 1)) {
      if (!is_known_) break;
      turn_to(low, point, halvings_max);
      low = point.angle;
    }
    const double half = on_axis(pi) - last_;
    return is_known_ && num_quarters_ + half - 4.0 * std::round(half / 4.0) == 0.0;
  }

 private:
  static constexpr double radius = 1.0 + 1e-6;
  static constexpr int halvings_max = 40;

  [[nodiscard]] double on_axis(double angle) const {
    return at(sum_, angle, radius).real() >= 0.0 ? 0.0 : 2.0;
  }

  /// Where it may have passed on either side of 0, its way is looked at more closely.
  void turn_to(double low, const GridPoint& high, int num_halvings) {
    const ComplexDouble there = at(sum_, high.turn, radius);
    const double step = quadrant(there) - last_;
    const double turned = step - 4.0 * std::round(step / 4.0);
    if (!std::isfinite(norm(there)) || (std::abs(turned) > 1.0 && num_halvings == 0)) {
      is_known_ = false;
    } else if (std::abs(turned) > 1.0) {
      const double middle = 0.5 * (low + high.angle);
      turn_to(low, {middle, sincos(middle)}, num_halvings - 1);
      if (is_known_) turn_to(middle, high, num_halvings - 1);
    } else {
      num_quarters_ += turned;
      last_ += step;
    }
  }

  const OpenLoop& sum_;
  std::span<const GridPoint> points_;
  double last_ = 0.0;  ///< Quadrant.
  double num_quarters_ = 0.0;
  bool is_known_ = true;  ///< False if a zero is on the circle, or L is no number.
};

}  // namespace

Margins margins_of(const OpenLoop& open_loop, const Resonances& resonances) {
  // Beside a pole 1 + L makes half a turn at once, in either direction, and with a zero of its own
  // there a whole one, which no quadrant tells: without the poles it makes half a turn at most.
  const OpenLoop sum = [&](ComplexDouble z_inverse) {
    ComplexDouble whole = 1.0 + open_loop(z_inverse);
    for (const ComplexDouble pole : resonances.poles) {
      whole = (1.0 - pole * z_inverse) * ((1.0 - conjugate(pole) * z_inverse) * whole);
    }
    return whole;
  };
  std::vector<GridPoint> own_points;
  std::span<const GridPoint> points = grid();
  if (!resonances.poles.empty() || !resonances.zeros.empty()) {
    own_points = points_for(resonances);
    points = own_points;
  }
  if (!Winding(sum, points).is_none()) return {};
  const auto excess = [&](double angle) { return norm(at(open_loop, angle)) - 1.0; };
  const auto height = [&](double angle) { return at(open_loop, angle).imag(); };
  Margins margins{std::numeric_limits<double>::infinity(), pi};
  double high = 0.0;
  ComplexDouble at_high = at(open_loop, first_angle);
  for (const GridPoint& point : points) {
    const double low = std::exchange(high, point.angle);
    const ComplexDouble at_low = std::exchange(at_high, at(open_loop, point.turn, 1.0));
    if ((norm(at_low) > 1.0) != (norm(at_high) > 1.0)) {
      const double there = at(open_loop, root(excess, low, high)).real();
      // |L| is 1, so −L has the cosine −Re L.
      const auto above = [&](double phase) { return sincos(phase).cosine + there; };
      margins.phase_rad = std::min(margins.phase_rad, root(above, 0.0, pi));
    }
    // At half the sample rate L is real: its phase reaches the axis there, or crosses it before.
    if ((at_low.imag() > 0.0) != (at_high.imag() > 0.0) || high == pi) {
      const double there = at(open_loop, root(height, low, high)).real();
      if (there < 0.0) margins.gain = std::min(margins.gain, std::max(-there, -1.0 / there));
    }
  }
  return margins;
}

}  // namespace proofmass
