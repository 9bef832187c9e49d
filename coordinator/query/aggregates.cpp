#include "coordinator/query/aggregates.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "core/error.hpp"
#include "core/statistics/correlation.hpp"
#include "core/statistics/moments.hpp"
#include "core/statistics/order.hpp"
#include "core/statistics/requirement.hpp"

namespace proofmass::coordinator {
namespace {

// Values beyond are scaled: fourth powers of what is 2^-53 of them stay in the range of a double.
constexpr int exponent_max = 128;

// A coverage or a confidence that SQL states in per cent, as a fraction. One below 1 % is of no use
// and would be a fraction where per cent is meant.
double fraction_of(std::string_view name, double per_cent) {
  if (per_cent >= 1.0 && per_cent < 100.0) return per_cent / 100.0;
  throw InvalidArgument(
      fmt::format("{} = {} (must be per cent in [1, 100), not a fraction)", name, per_cent));
}

bool varies(std::span<const double> column) {
  return std::ranges::any_of(column, [&](double value) { return value != column.front(); });
}

std::optional<double> stdev(const AggregateColumns& columns) {
  if (columns.x.size() < 2) return std::nullopt;
  if (!varies(columns.x)) return 0.0;
  return moments(columns.x).standard_deviation;
}

template <double Moments::*shape, std::size_t num_min>
std::optional<double> shape_of(const AggregateColumns& columns) {
  if (columns.x.size() < num_min || !varies(columns.x)) return std::nullopt;
  return moments(columns.x).*shape;
}

// As percentile(), but for values whose difference is no finite double too.
double percentile_at(std::span<const double> ascending, double level) {
  const OrderPlace place = percentile_place(ascending.size(), level);
  const double from = ascending[place.from];
  const double to = ascending[place.to];
  const double value = place.between(from, to);
  return std::isfinite(value) ? value : 2.0 * place.between(0.5 * from, 0.5 * to);
}

std::optional<double> percentile_of(const AggregateColumns& columns) {
  const double percent = columns.parameters[0];
  if (!(percent >= 0.0 && percent <= 100.0)) {
    throw InvalidArgument(fmt::format("p = {} (must be in [0, 100])", percent));
  }
  if (columns.x.empty()) return std::nullopt;
  return percentile_at(columns.x, percent / 100.0);
}

std::optional<double> median(const AggregateColumns& columns) {
  if (columns.x.empty()) return std::nullopt;
  return percentile_at(columns.x, 0.5);
}

// SQL has y first: regr_slope(y, x).
template <double RegressionLine::*number>
std::optional<double> of_line(const AggregateColumns& columns) {
  const std::optional<RegressionLine> line = fit_line(columns.y, columns.x);
  if (!line) return std::nullopt;
  return (*line).*number;
}

std::optional<double> linear(const AggregateColumns& columns) {
  if (!varies(columns.x) || !varies(columns.y)) return std::nullopt;
  return linear_correlation(columns.x, columns.y);
}

std::optional<double> rank(const AggregateColumns& columns) {
  return rank_correlation(columns.x, columns.y);
}

// A NULL stands for a run without an estimate, which is no evidence for a bound: it counts as
// larger than any value.
std::optional<double> tolerance_bound(const AggregateColumns& columns) {
  const Tolerance tolerance{.coverage = fraction_of("coverage", columns.parameters[0]),
                            .confidence = fraction_of("confidence", columns.parameters[1])};
  return wilks_upper(columns.x, tolerance, columns.num_unknown);
}

/// Sorts what stands behind the sorted ones, and merges both.
template <typename Row>
void sort_behind(std::vector<Row>& rows, std::size_t num_sorted) {
  const auto middle = rows.begin() + static_cast<std::ptrdiff_t>(num_sorted);
  std::sort(middle, rows.end());
  std::inplace_merge(rows.begin(), middle, rows.end());
}

/// Removes one of the equal rows, which have the same bits.
template <typename Row>
void remove_from(std::vector<Row>& ascending, const Row& row) {
  const auto place = std::lower_bound(ascending.begin(), ascending.end(), row);
  PROOFMASS_EXPECT(place != ascending.end() && *place == row);
  ascending.erase(place);
}

/// Exponent of the power of two by which a column is divided; 0 if it is not.
int scale_of(std::span<const double> column) {
  double largest = 0.0;
  for (const double value : column) largest = std::max(largest, std::abs(value));
  if (largest == 0.0) return 0;
  const int exponent = std::ilogb(largest);
  return std::abs(exponent) <= exponent_max ? 0 : exponent;
}

std::vector<double> scaled(std::span<const double> column, int exponent) {
  std::vector<double> values(column.begin(), column.end());
  for (double& value : values) value = std::ldexp(value, -exponent);
  return values;
}

constexpr double num_runs_counted_max = 1e9;

double count_of(std::string_view name, double value, double largest) {
  if (value >= 0.0 && value <= largest && std::floor(value) == value) return value;
  throw InvalidArgument(
      fmt::format("{} = {} (must be a whole number in [0, {}])", name, value, largest));
}

}  // namespace

std::span<const Aggregate> aggregates() {
  static constexpr std::array<std::string_view, 1> one_column{"x"};
  static constexpr std::array<std::string_view, 2> two_columns{"x", "y"};
  static constexpr std::array<std::string_view, 2> with_percent{"x", "p"};
  static constexpr std::array<std::string_view, 3> with_tolerance{"x", "coverage", "confidence"};
  static constexpr std::array<std::string_view, 2> response_first{"y", "x"};
  static constexpr std::array<Aggregate, 11> all{{
      {"stdev", one_column, 1, ScalePowers{.x = 1}, stdev},
      {"skewness", one_column, 1, ScalePowers{}, shape_of<&Moments::skewness, 3>},
      {"kurtosis", one_column, 1, ScalePowers{}, shape_of<&Moments::excess_kurtosis, 4>},
      {"median", one_column, 1, {}, median},
      {"percentile", with_percent, 1, {}, percentile_of},
      {"correlation", two_columns, 2, ScalePowers{}, linear},
      {"corr", response_first, 2, ScalePowers{}, linear},
      {"rank_correlation", two_columns, 2, {}, rank},
      {"regr_slope", response_first, 2, ScalePowers{.x = 1, .y = -1},
       of_line<&RegressionLine::slope>},
      {"regr_intercept", response_first, 2, ScalePowers{.x = 1},
       of_line<&RegressionLine::intercept>},
      {"wilks_upper", with_tolerance, 1, {}, tolerance_bound},
  }};
  return all;
}

AggregateRows::AggregateRows(const Aggregate& aggregate, std::size_t num_rows_max)
    : aggregate_(&aggregate), num_rows_max_(num_rows_max) {}

void AggregateRows::add(std::span<const std::optional<double>> arguments) {
  const std::span names = aggregate_->arguments;
  PROOFMASS_EXPECT(arguments.size() == names.size());
  add_parameters(arguments.subspan(aggregate_->num_columns));
  const auto columns = arguments.first(aggregate_->num_columns);
  if (!std::ranges::all_of(columns, [](const auto& value) { return value.has_value(); })) {
    ++num_unknown_;
    return;
  }
  for (std::size_t i = 0; i < columns.size(); ++i) {
    if (std::isfinite(*columns[i])) continue;
    throw InvalidArgument(fmt::format("{} = {} (must be finite)", names[i], *columns[i]));
  }
  if (values_.size() + pairs_.size() == num_rows_max_) {
    throw InvalidArgument(
        fmt::format("{} > {} rows (too many to collect)", names[0], num_rows_max_));
  }
  // A negative zero becomes one like the others.
  if (columns.size() == 1) {
    values_.push_back(*columns[0] + 0.0);
  } else {
    pairs_.emplace_back(*columns[0] + 0.0, *columns[1] + 0.0);
  }
}

void AggregateRows::remove(std::span<const std::optional<double>> arguments) {
  const auto columns = arguments.first(aggregate_->num_columns);
  if (!std::ranges::all_of(columns, [](const auto& value) { return value.has_value(); })) {
    PROOFMASS_EXPECT(num_unknown_ > 0);
    --num_unknown_;
    return;
  }
  sort();
  if (columns.size() == 1) {
    remove_from(values_, *columns[0] + 0.0);
  } else {
    remove_from(pairs_, {*columns[0] + 0.0, *columns[1] + 0.0});
  }
  --num_sorted_;
}

void AggregateRows::sort() {
  sort_behind(values_, aggregate_->num_columns == 1 ? num_sorted_ : 0);
  sort_behind(pairs_, aggregate_->num_columns == 1 ? 0 : num_sorted_);
  num_sorted_ = values_.size() + pairs_.size();
}

void AggregateRows::add_parameters(std::span<const std::optional<double>> arguments) {
  const bool is_first = parameters_.empty();
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    const std::string_view name = aggregate_->arguments[aggregate_->num_columns + i];
    if (!arguments[i]) throw InvalidArgument(fmt::format("{} = NULL (must be a number)", name));
    if (is_first) parameters_.push_back(*arguments[i]);
    if (parameters_[i] == *arguments[i]) continue;
    throw InvalidArgument(fmt::format("{} = {} (must be the same for all rows, was {})", name,
                                      *arguments[i], parameters_[i]));
  }
}

std::optional<double> AggregateRows::value() {
  if (parameters_.size() + aggregate_->num_columns < aggregate_->arguments.size()) return {};
  sort();
  if (aggregate_->num_columns == 1) return evaluate_scaled(values_, {});
  std::vector<double> x(pairs_.size()), y(pairs_.size());
  std::ranges::transform(pairs_, x.begin(), [](const auto& pair) { return pair.first; });
  std::ranges::transform(pairs_, y.begin(), [](const auto& pair) { return pair.second; });
  return evaluate_scaled(x, y);
}

std::optional<double> AggregateRows::evaluate_scaled(std::span<const double> x,
                                                     std::span<const double> y) const {
  if (!aggregate_->powers) return evaluate(x, y);
  const int x_exponent = scale_of(x);
  const int y_exponent = scale_of(y);
  if (x_exponent == 0 && y_exponent == 0) return evaluate(x, y);
  const auto result = evaluate(scaled(x, x_exponent), scaled(y, y_exponent));
  if (!result) return std::nullopt;
  const ScalePowers& powers = *aggregate_->powers;
  const double value = std::ldexp(*result, powers.x * x_exponent + powers.y * y_exponent);
  if (std::isfinite(value)) return value;
  throw InvalidArgument(
      fmt::format("{} is too large (the result is no finite double)", aggregate_->arguments[0]));
}

std::optional<double> AggregateRows::evaluate(std::span<const double> x,
                                              std::span<const double> y) const {
  return aggregate_->evaluate(
      {.x = x, .y = y, .num_unknown = num_unknown_, .parameters = parameters_});
}

std::optional<Interval> binomial_interval(std::span<const std::optional<double>> arguments) {
  const bool is_known =
      std::ranges::all_of(arguments, [](const auto& argument) { return argument.has_value(); });
  if (!is_known) return std::nullopt;
  const double num_runs = count_of("runs", *arguments[1], num_runs_counted_max);
  const double num_hits = count_of("hits", *arguments[0], num_runs);
  const double confidence = fraction_of("confidence", *arguments[2]);
  if (num_runs == 0.0) return std::nullopt;
  return probability_interval(num_hits, num_runs, confidence);
}

}  // namespace proofmass::coordinator
