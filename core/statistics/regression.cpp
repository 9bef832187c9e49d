#include "core/statistics/regression.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "core/statistics/detail/check.hpp"
#include "core/statistics/sum.hpp"

namespace proofmass {

std::optional<RegressionLine> fit_line(std::span<const double> x, std::span<const double> y) {
  detail::check_same_size("y", y, x);
  detail::check_values("x", x, 0);
  detail::check_values("y", y, 0);
  if (x.size() < 2) return std::nullopt;
  if (std::ranges::all_of(x, [&](double value) { return value == x[0]; })) return std::nullopt;
  const auto n = static_cast<double>(x.size());
  const double x_centre = compensated_sum(x) / n;
  const double y_centre = compensated_sum(y) / n;
  CompensatedSum sum_x, sum_y, sum_xx, sum_xy;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double dx = x[i] - x_centre;
    const double dy = y[i] - y_centre;
    sum_x.add(dx);
    sum_y.add(dy);
    sum_xx.add(dx * dx);
    sum_xy.add(dx * dy);
  }
  // What the rounded means lack, and central sums corrected for it.
  const double x_rest = sum_x.value() / n;
  const double y_rest = sum_y.value() / n;
  const double xx = sum_xx.value() - n * x_rest * x_rest;
  const double slope = (sum_xy.value() - n * x_rest * y_rest) / xx;

  // The same slope of the residuals is what the rounded one lacks.
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
