#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "core/campaign/parameter.hpp"
#include "core/campaign/run_result.hpp"

namespace proofmass::coordinator {

/// What is known of a parameter in one run, or of the health of its loops.
enum class ValueKind : std::uint8_t { truth, estimate, error, health };

/// `truth`, `estimate`, `error`, `health`.
[[nodiscard]] std::string_view name_of(ValueKind kind);

/// True if both are the same to the last bit; zeros have no sign, as in a campaign file.
[[nodiscard]] inline bool have_same_bits(double a, double b) {
  return std::bit_cast<std::uint64_t>(a + 0.0) == std::bit_cast<std::uint64_t>(b + 0.0);
}

/// A column of doubles, one for each run, SI.
struct ValueColumn {
  ValueKind kind = ValueKind::truth;
  Parameter parameter = Parameter::a_c11_delta_x;  ///< Unless the kind is `health`.
  double LoopHealth::*health = nullptr;            ///< If it is.
  std::string own_name;                            ///< With its unit: `a_c12_rad`, `attitude_rad`.
  std::string name;       ///< As in the table `run_result`: `truth_a_c12_rad`.
  std::string_view unit;  ///< `m`, `rad`, `s²/m`, `m/s²` or `1`.

  /// Nothing if the run's status leaves it without a meaning.
  [[nodiscard]] std::optional<double> value_in(const RunResult& result) const;
};

inline constexpr std::size_t num_value_columns = 3 * num_parameters + num_health_values;

/// Ten truths, ten estimates, ten errors, five numbers of health, in the order of the table
/// `run_result`.
[[nodiscard]] const std::array<ValueColumn, num_value_columns>& value_columns();

}  // namespace proofmass::coordinator
