#include "core/statistics/correlation.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "core/statistics/detail/check.hpp"
#include "core/statistics/moments.hpp"
#include "core/statistics/order.hpp"

namespace proofmass {
namespace {

// Central sums with d = x − c, each corrected for what the rounded mean c lacks (see moments.hpp).
std::optional<double> coefficient_of(std::span<const double> x, std::span<const double> y) {
  const auto n = static_cast<double>(x.size());
  const double x_centre = compensated_sum(x) / n;
  const double y_centre = compensated_sum(y) / n;
  CompensatedSum sum_x, sum_y, sum_xx, sum_yy, sum_xy;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double dx = x[i] - x_centre;
    const double dy = y[i] - y_centre;
    sum_x.add(dx);
    sum_y.add(dy);
    sum_xx.add(dx * dx);
    sum_yy.add(dy * dy);
    sum_xy.add(dx * dy);
  }
  const double xx = sum_xx.value() - sum_x.value() * sum_x.value() / n;
  const double yy = sum_yy.value() - sum_y.value() * sum_y.value() / n;
  const double xy = sum_xy.value() - sum_x.value() * sum_y.value() / n;
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
