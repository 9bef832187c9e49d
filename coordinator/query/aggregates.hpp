#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

namespace proofmass::coordinator {

/// Most rows that one aggregate collects: all |error| of three million runs, 268 MB a column.
inline constexpr std::size_t aggregate_rows_max = std::size_t{1} << 25;

/// What an aggregate was handed, in ascending order, with equal zeros: SQL promises no order of
/// rows, and a function of sorted values does not depend on it.
struct AggregateColumns {
  std::vector<double> x;
  std::vector<double> y;               ///< Empty with one column; pairs are sorted by x, then y.
  std::uint64_t num_unknown = 0;       ///< Rows with a NULL.
  std::span<const double> parameters;  ///< The arguments behind the columns.
};

inline constexpr std::size_t aggregate_arguments_max = 3;

/// A function that makes one number of the rows of an SQL group.
struct Aggregate {
  const char* name;
  std::span<const std::string_view> arguments;  ///< Names: columns first, then parameters.
  std::size_t num_columns;                      ///< 1 or 2; the other arguments are parameters.
  /// Empty if the rows are too few or do not vary; NULL in SQL.
  /// @throws InvalidArgument if a parameter breaks its rule.
  std::optional<double> (*evaluate)(const AggregateColumns& columns);
};

/// stdev, percentile, skewness, correlation, rank_correlation, wilks_upper; see README.md.
[[nodiscard]] std::span<const Aggregate> aggregates();

/// The rows of one group while they come in.
class AggregateRows {
 public:
  /// @param aggregate  From aggregates().
  explicit AggregateRows(const Aggregate& aggregate, std::size_t num_rows_max = aggregate_rows_max);

  /// Adds a row; one with a NULL among its columns is only counted.
  /// @param arguments  One for each argument of the aggregate; empty is NULL.
  /// @throws InvalidArgument if a value is not finite, if a parameter is NULL or differs from that
  ///         of the first row, or if there are too many rows.
  void add(std::span<const std::optional<double>> arguments);

  /// The aggregate of all rows; empty if the first was refused. @throws as Aggregate::evaluate.
  [[nodiscard]] std::optional<double> value();

 private:
  void add_parameters(std::span<const std::optional<double>> arguments);

  const Aggregate* aggregate_;
  std::size_t num_rows_max_;
  std::vector<double> parameters_;
  AggregateColumns columns_;
};

}  // namespace proofmass::coordinator
