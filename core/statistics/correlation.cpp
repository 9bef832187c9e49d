#include "core/statistics/correlation.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "core/statistics/detail/check.hpp"
#include "core/statistics/moments.hpp"
#include "core/statistics/order.hpp"

namespace proofmass {
namespace {

/// Sums of d = x − c, c being the rounded mean, which lacks a little; see moments.hpp.
struct CentralSums {
  CentralSums(std::span<const double> xs, std::span<const double> ys)
      : n(static_cast<double>(xs.size())),
        x_centre(compensated_sum(xs) / n),
        y_centre(compensated_sum(ys) / n) {
    for (std::size_t i = 0; i < xs.size(); ++i) {
      const double dx = xs[i] - x_centre;
      const double dy = ys[i] - y_centre;
      x.add(dx);
      y.add(dy);
      xx.add(dx * dx);
      yy.add(dy * dy);
      xy.add(dx * dy);
    }
  }

  double n, x_centre, y_centre;
  CompensatedSum x, y, xx, yy, xy;
};

std::optional<double> coefficient_of(std::span<const double> x, std::span<const double> y) {
  const CentralSums sums(x, y);
  const double xx = sums.xx.value() - sums.x.value() * sums.x.value() / sums.n;
  const double yy = sums.yy.value() - sums.y.value() * sums.y.value() / sums.n;
  const double xy = sums.xy.value() - sums.x.value() * sums.y.value() / sums.n;
  if (xx <= 0.0 || yy <= 0.0) return std::nullopt;
  return std::clamp(xy / std::sqrt(xx) / std::sqrt(yy), -1.0, 1.0);
}

void check_columns(std::span<const double> x, std::span<const double> y) {
  detail::check_same_size("y", y, x);
  detail::check_values("x", x, 0);
  detail::check_values("y", y, 0);
}

}  // namespace

std::optional<double> linear_correlation(std::span<const double> x, std::span<const double> y) {
  check_columns(x, y);
  return x.size() < 4 ? std::nullopt : coefficient_of(x, y);
}

std::optional<double> rank_correlation(std::span<const double> x, std::span<const double> y) {
  check_columns(x, y);
  return x.size() < 4 ? std::nullopt : coefficient_of(average_ranks(x), average_ranks(y));
}

std::optional<RegressionLine> fit_line(std::span<const double> x, std::span<const double> y) {
  check_columns(x, y);
  if (x.size() < 2) return std::nullopt;
  if (std::ranges::all_of(x, [&](double value) { return value == x[0]; })) return std::nullopt;
  const CentralSums sums(x, y);
  const double n = sums.n, x_centre = sums.x_centre, y_centre = sums.y_centre;
  // What the rounded means lack, and central sums corrected for it.
  const double x_rest = sums.x.value() / n;
  const double y_rest = sums.y.value() / n;
  const double xx = sums.xx.value() - n * x_rest * x_rest;
  const double slope = (sums.xy.value() - n * x_rest * y_rest) / xx;

  // The slope of the residuals is what the rounded slope lacks.
  CompensatedSum sum_rest;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double dx = x[i] - x_centre - x_rest;
    const double dy = y[i] - y_centre - y_rest;
    sum_rest.add(dx * std::fma(-slope, dx, dy));
  }
  const double slope_rest = sum_rest.value() / xx;

  const double product = slope * x_centre;
  const double product_rest = std::fma(slope, x_centre, -product);
  CompensatedSum intercept;
  for (const double term :
       {y_centre, -product, -product_rest, y_rest, -slope * x_rest, -slope_rest * x_centre}) {
    intercept.add(term);
  }
  return RegressionLine{.slope = slope + slope_rest, .intercept = intercept.value()};
}

}  // namespace proofmass
