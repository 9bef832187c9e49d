#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "core/statistics/interval.hpp"

struct sqlite3;

namespace proofmass::coordinator {

/// Most rows that one aggregate collects: all |error| of three million runs, 268 MB a column.
inline constexpr std::size_t aggregate_rows_max = std::size_t{1} << 25;

/// What an aggregate was handed, in ascending order, with equal zeros: SQL promises no order of
/// rows, and a function of sorted values does not depend on it.
struct AggregateColumns {
  std::span<const double> x;           ///< The first column.
  std::span<const double> y;           ///< The second; pairs are sorted by x, then y.
  std::uint64_t num_unknown = 0;       ///< Rows with a NULL.
  std::span<const double> parameters;  ///< The arguments behind the columns.
};

inline constexpr std::size_t aggregate_arguments_max = 3;

/// What becomes of a result if the columns are multiplied: f(a x, b y) = a^x b^y f(x, y).
struct ScalePowers {
  int x = 0;
  int y = 0;
};

/// A function that makes one number of the rows of an SQL group.
struct Aggregate {
  const char* name;
  std::span<const std::string_view> arguments;  ///< Names: columns first, then parameters.
  std::size_t num_columns;                      ///< 1 or 2; the other arguments are parameters.
  /// Columns beyond 2^±128 are scaled by a power of two, which changes no digit, so that no square
  /// leaves the range of a double; empty if the function takes values as they are.
  std::optional<ScalePowers> powers;
  /// Empty if the rows are too few or do not vary; NULL in SQL.
  /// @throws InvalidArgument if a parameter breaks its rule.
  std::optional<double> (*evaluate)(const AggregateColumns& columns);
};

/// stdev, median, regr_slope and others; see README.md.
[[nodiscard]] std::span<const Aggregate> aggregates();

/// The rows of one group or of one window frame, while they come and go. The values are kept in
/// ascending order from one value() to the next: another row costs a shift of the others, and a
/// function is always computed anew, so that a frame has the bits of a group with the same rows.
class AggregateRows {
 public:
  /// @param aggregate  From aggregates().
  explicit AggregateRows(const Aggregate& aggregate, std::size_t num_rows_max = aggregate_rows_max);

  /// Adds a row; one with a NULL among its columns is only counted.
  /// @param arguments  One for each argument of the aggregate; empty is NULL.
  /// @throws InvalidArgument if a value is not finite, if a parameter is NULL or differs from that
  ///         of the first row, or if there are too many rows.
  void add(std::span<const std::optional<double>> arguments);

  /// Takes a row away again. @pre add() took it.
  void remove(std::span<const std::optional<double>> arguments);

  /// The aggregate of all rows; empty if the first was refused. @throws as Aggregate::evaluate, and
  /// InvalidArgument if the result is no finite double.
  [[nodiscard]] std::optional<double> value();

 private:
  void add_parameters(std::span<const std::optional<double>> arguments);
  void sort();
  [[nodiscard]] std::optional<double> evaluate(std::span<const double> x,
                                               std::span<const double> y) const;
  [[nodiscard]] std::optional<double> evaluate_scaled(std::span<const double> x,
                                                      std::span<const double> y) const;

  const Aggregate* aggregate_;
  std::size_t num_rows_max_;
  std::vector<double> parameters_;
  std::uint64_t num_unknown_ = 0;
  std::size_t num_sorted_ = 0;  ///< The first ones, of the values or of the pairs.
  std::vector<double> values_;  ///< Of an aggregate with one column.
  std::vector<std::pair<double, double>> pairs_;  ///< Of one with two.
};

/// Names of the arguments of binomial_interval(), for messages.
inline constexpr std::array<std::string_view, 3> binomial_interval_arguments{"hits", "runs",
                                                                             "confidence"};

/// The interval between binomial_interval_lower and binomial_interval_upper; see README.md.
/// @param arguments  Empty is NULL.
/// @returns Empty (NULL in SQL) if an argument is NULL or there are no runs.
/// @throws InvalidArgument if an argument breaks its rule.
[[nodiscard]] std::optional<Interval> binomial_interval(
    std::span<const std::optional<double>> arguments);

/// Adds the tables draw(campaign), one row a run and drawn quantity, and
/// definition_entry(campaign), one row a key of the campaign file (see README.md).
/// @returns SQLite's result code.
[[nodiscard]] int register_tables(sqlite3* connection);

/// Adds all functions and tables of README.md to a connection.
/// @returns SQLite's result code.
[[nodiscard]] int register_functions(sqlite3* connection);

}  // namespace proofmass::coordinator
