#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/campaign/run_result.hpp"

namespace proofmass {

/// What is known of a quantity in one run, or of the health of the run.
enum class ValueKind : std::uint8_t { truth, estimate, error, standard_error, fit, health };

/// `truth`, `estimate`, `error`, `standard_error`, `fit`, `health`.
[[nodiscard]] std::string_view name_of(ValueKind kind);

/// True if both are the same to the last bit; zeros have no sign, as in a campaign database.
[[nodiscard]] inline bool have_same_bits(double a, double b) {
  return std::bit_cast<std::uint64_t>(a + 0.0) == std::bit_cast<std::uint64_t>(b + 0.0);
}

/// A column of doubles, one for each run, SI.
struct ValueColumn {
  ValueKind kind = ValueKind::truth;
  std::size_t index = 0;  ///< Of the value in its list of a RunResult.
  std::string own_name;   ///< With its unit: `offset_m`, `acceleration_m_s2`.
  std::string name;       ///< As in the table `run_result`: `truth_offset_m`.
  std::string_view unit;  ///< `m`, `rad`, `s²/m`, `m/s²` or `1`.

  /// Nothing if the run's status leaves it without a meaning.
  [[nodiscard]] std::optional<double> value_in(const RunResult& result) const;
};

/// Truths, estimates, errors, standard errors and their fit if there are any, and health: all
/// columns of values of the table `run_result`.
[[nodiscard]] std::vector<ValueColumn> value_columns(const ResultSchema& schema);

/// The names of all columns of that table, with those that no value is in: `run_index`, `status`.
[[nodiscard]] std::vector<std::string> result_column_names(const ResultSchema& schema);

}  // namespace proofmass
