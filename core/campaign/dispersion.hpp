#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/campaign/identifiers.hpp"

namespace proofmass {

/// Shape of a drawn quantity's distribution.
enum class Law : std::uint8_t {
  uniform = 1,           ///< On [minimum, maximum].
  normal = 2,            ///< mean, standard_deviation.
  truncated_normal = 3,  ///< The same, inside [minimum, maximum].
  fixed = 4,             ///< value.
  table = 5,             ///< One value a run, from a column of a file.
};

[[nodiscard]] std::span<const std::string_view> names_of(Law);

/// Most bytes of the name of a data file or of a column.
inline constexpr std::size_t data_name_size_max = 1024;

/// The law of one drawn quantity; only the fields of its law mean something, the others are 0.
struct Dispersion {
  Law law = Law::uniform;
  double minimum = 0.0;
  double maximum = 0.0;
  double mean = 0.0;
  double standard_deviation = 0.0;
  double value = 0.0;
  std::string file;    ///< For `table`: path as written in the campaign file.
  std::string column;  ///< For `table`: heading of the column.

  bool operator==(const Dispersion&) const = default;

  /// @throws ConfigError naming `path.field`, e.g. `dispersion.offcentring_m.minimum`.
  void validate(std::string_view path) const;
};

/// Quantities that are drawn together by nature, such as the six scale factors.
struct DrawGroup {
  std::string_view name;     ///< `scale_factor_error`.
  std::string_view comment;  ///< One line: meaning and unit.
  double bound;              ///< Nominal law: uniform on ±bound.
  std::size_t first;         ///< Index of its first element among all.
  std::size_t count;
};

inline constexpr std::size_t num_draw_groups = 12;
inline constexpr std::size_t num_drawn = 60;

/// The groups in file order; together they cover all drawn quantities once.
[[nodiscard]] const std::array<DrawGroup, num_draw_groups>& draw_groups();

/// Names of all drawn quantities: `scale_factor_error.sensor_1_x`. The name is that of the random
/// stream, so it must never change.
[[nodiscard]] const std::array<std::string, num_drawn>& drawn_names();

/// A value for each drawn quantity, indexed like drawn_names().
using DrawnValues = std::array<double, num_drawn>;
using DispersionSet = std::array<Dispersion, num_drawn>;

/// Uniform laws inside the construction bounds of MICROSCOPE.
[[nodiscard]] DispersionSet nominal_dispersions();

/// Indices of the quantities with law `table`, ascending.
[[nodiscard]] std::vector<std::size_t> table_elements(const DispersionSet& dispersions);

/// The values of a run's draw number `draw` (from 0), before any acceptance rule: a pure function
/// of its arguments.
///
/// @param table_values  The run's values of the `table` quantities, in the order of
/// table_elements().
[[nodiscard]] DrawnValues draw_values(const DispersionSet& dispersions, std::uint64_t seed,
                                      RunIndex run, std::uint32_t draw,
                                      std::span<const double> table_values);

}  // namespace proofmass
