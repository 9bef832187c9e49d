#include "coordinator/query/interval_functions.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "core/error.hpp"
#include "core/statistics/interval.hpp"

namespace proofmass::coordinator {
namespace {

constexpr double num_runs_counted_max = 1e9;

double count_of(std::string_view name, double value, double largest) {
  if (value >= 0.0 && value <= largest && std::floor(value) == value) return value;
  throw InvalidArgument(
      fmt::format("{} = {} (must be a whole number in [0, {}])", name, value, largest));
}

std::optional<Interval> interval_of(std::span<const std::optional<double>> arguments) {
  const bool is_known =
      std::ranges::all_of(arguments, [](const auto& argument) { return argument.has_value(); });
  if (!is_known) return std::nullopt;
  const double num_runs = count_of("runs", *arguments[1], num_runs_counted_max);
  const double num_hits = count_of("hits", *arguments[0], num_runs);
  const double confidence = fraction_of("confidence", *arguments[2]);
  if (num_runs == 0.0) return std::nullopt;
  return probability_interval(num_hits, num_runs, confidence);
}

std::optional<double> lower(std::span<const std::optional<double>> arguments) {
  const std::optional<Interval> interval = interval_of(arguments);
  if (!interval) return std::nullopt;
  return interval->lower;
}

std::optional<double> upper(std::span<const std::optional<double>> arguments) {
  const std::optional<Interval> interval = interval_of(arguments);
  if (!interval) return std::nullopt;
  return interval->upper;
}

}  // namespace

double fraction_of(std::string_view name, double per_cent) {
  if (per_cent >= 1.0 && per_cent < 100.0) return per_cent / 100.0;
  throw InvalidArgument(
      fmt::format("{} = {} (must be per cent in [1, 100), not a fraction)", name, per_cent));
}

std::span<const std::string_view> interval_argument_names() {
  static constexpr std::array<std::string_view, interval_arguments> names{"hits", "runs",
                                                                          "confidence"};
  return names;
}

std::span<const IntervalFunction> interval_functions() {
  static constexpr std::array<IntervalFunction, 2> all{
      {{"binomial_interval_lower", lower}, {"binomial_interval_upper", upper}}};
  return all;
}

}  // namespace proofmass::coordinator
