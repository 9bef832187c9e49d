#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string_view>

namespace proofmass::coordinator {

inline constexpr std::size_t interval_arguments = 3;

/// A function of one row that yields one bound of an interval.
struct IntervalFunction {
  const char* name;
  /// @param arguments  hits, runs, confidence; empty is NULL.
  /// @returns Empty (NULL in SQL) if an argument is NULL or there are no runs.
  /// @throws InvalidArgument if an argument breaks its rule.
  std::optional<double> (*evaluate)(std::span<const std::optional<double>> arguments);
};

/// Names of the arguments, for messages.
[[nodiscard]] std::span<const std::string_view> interval_argument_names();

/// binomial_interval_lower and binomial_interval_upper; see README.md.
[[nodiscard]] std::span<const IntervalFunction> interval_functions();

/// A coverage or a confidence that SQL states in per cent, as a fraction. One below 1 % is of no
/// use and would be a fraction where per cent is meant.
/// @param name  Of the argument, for the message.
/// @throws InvalidArgument unless it is in [1, 100).
[[nodiscard]] double fraction_of(std::string_view name, double per_cent);

}  // namespace proofmass::coordinator
