#include "coordinator/query/aggregates.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>
#include <utility>

#include "core/error.hpp"
#include "core/statistics/correlation.hpp"
#include "core/statistics/moments.hpp"
#include "core/statistics/order.hpp"
#include "core/statistics/tolerance.hpp"

namespace proofmass::coordinator {
namespace {

// Of a coefficient of correlation only the interval depends on it.
constexpr double any_confidence = 0.95;

std::optional<double> stdev(const AggregateColumns& columns) {
  if (columns.x.size() < 2) return std::nullopt;
  return moments(columns.x).standard_deviation;
}

std::optional<double> skewness(const AggregateColumns& columns) {
  if (columns.x.size() < 3 || columns.x.front() == columns.x.back()) return std::nullopt;
  return moments(columns.x).skewness;
}

std::optional<double> percentile_of(const AggregateColumns& columns) {
  const double percent = columns.parameters[0];
  if (!(percent >= 0.0 && percent <= 100.0)) {
    throw InvalidArgument(fmt::format("p = {} (must be in [0, 100])", percent));
  }
  if (columns.x.empty()) return std::nullopt;
  return percentile(columns.x, percent / 100.0);
}

std::optional<double> coefficient(const std::optional<Correlation>& correlation) {
  if (!correlation) return std::nullopt;
  return correlation->coefficient;
}

std::optional<double> linear(const AggregateColumns& columns) {
  return coefficient(linear_correlation(columns.x, columns.y, any_confidence));
}

std::optional<double> rank(const AggregateColumns& columns) {
  return coefficient(rank_correlation(columns.x, columns.y, any_confidence));
}

// A run without a number is one of which nothing is known to its advantage.
std::optional<double> tolerance_bound(const AggregateColumns& columns) {
  const Tolerance tolerance{.coverage = columns.parameters[0], .confidence = columns.parameters[1]};
  const auto bound = wilks_upper(columns.x, tolerance, columns.num_unknown);
  if (!bound) return std::nullopt;
  return bound->value;
}

void sort_pairs(std::vector<double>& x, std::vector<double>& y) {
  std::vector<std::pair<double, double>> pairs(x.size());
  for (std::size_t i = 0; i < pairs.size(); ++i) pairs[i] = {x[i], y[i]};
  std::sort(pairs.begin(), pairs.end());
  for (std::size_t i = 0; i < pairs.size(); ++i) std::tie(x[i], y[i]) = pairs[i];
}

}  // namespace

std::span<const Aggregate> aggregates() {
  static constexpr std::array<std::string_view, 1> one_column{"x"};
  static constexpr std::array<std::string_view, 2> two_columns{"x", "y"};
  static constexpr std::array<std::string_view, 2> with_percent{"x", "p"};
  static constexpr std::array<std::string_view, 3> with_tolerance{"x", "coverage", "confidence"};
  static constexpr std::array<Aggregate, 6> all{{
      {"stdev", one_column, 1, stdev},
      {"skewness", one_column, 1, skewness},
      {"percentile", with_percent, 1, percentile_of},
      {"correlation", two_columns, 2, linear},
      {"rank_correlation", two_columns, 2, rank},
      {"wilks_upper", with_tolerance, 1, tolerance_bound},
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
    ++columns_.num_unknown;
    return;
  }
  for (std::size_t i = 0; i < columns.size(); ++i) {
    if (std::isfinite(*columns[i])) continue;
    throw InvalidArgument(fmt::format("{} = {} (must be finite)", names[i], *columns[i]));
  }
  if (columns_.x.size() == num_rows_max_) {
    throw InvalidArgument(
        fmt::format("{} > {} rows (too many to collect)", names[0], num_rows_max_));
  }
  columns_.x.push_back(*columns[0] + 0.0);  // A negative zero becomes one like the others.
  if (columns.size() > 1) columns_.y.push_back(*columns[1] + 0.0);
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
  columns_.parameters = parameters_;
  if (aggregate_->num_columns == 1) {
    std::sort(columns_.x.begin(), columns_.x.end());
  } else {
    sort_pairs(columns_.x, columns_.y);
  }
  return aggregate_->evaluate(columns_);
}

}  // namespace proofmass::coordinator
