#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <string_view>

namespace proofmass {

/// Interval of admissible values of a field; an infinite end is no bound.
struct Range {
  double minimum = -std::numeric_limits<double>::infinity();
  double maximum = std::numeric_limits<double>::infinity();
  bool minimum_open = false;  ///< True if `minimum` itself is not admissible.

  [[nodiscard]] bool contains(double value) const;
  /// For people: `must be in (0, 1]`, `must be > 0`, `must be finite`.
  [[nodiscard]] std::string rule() const;
};

namespace range {
inline constexpr Range any{};
inline constexpr Range positive{.minimum = 0.0, .minimum_open = true};
inline constexpr Range not_negative{.minimum = 0.0};
[[nodiscard]] constexpr Range between(double minimum, double maximum) {
  return {.minimum = minimum, .maximum = maximum};
}
}  // namespace range

/// Spelling of an enumerator, of those that names_of() lists in value order from 1.
template <typename Choice>
requires requires(Choice choice) { names_of(choice); }
[[nodiscard]] std::string_view name_of(Choice choice) {
  return names_of(choice)[static_cast<std::size_t>(choice) - 1];
}

/// Name, meaning and rule of one number or choice of a scenario.
struct FieldInfo {
  std::string_view path;     ///< `estimation.transient_s`: table and key in a campaign file.
  std::string_view comment;  ///< One line: meaning, and where the default comes from.
  Range range = range::any;  ///< For numbers.
};

/// @throws ConfigError if the value is not finite or outside the field's range.
void check_field(const FieldInfo& field, double value);

}  // namespace proofmass
