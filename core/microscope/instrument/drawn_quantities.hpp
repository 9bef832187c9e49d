#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "core/campaign/dispersion.hpp"
#include "core/campaign/law_set.hpp"
#include "core/runs.hpp"

namespace proofmass {

/// Quantities that are drawn together by nature, such as the six scale factors.
struct DrawGroup {
  std::string_view name;     ///< `scale_factor_error`.
  std::string_view comment;  ///< One line: meaning and unit.
  double bound;              ///< Nominal law: uniform on ±bound; of eotvos_parameter fixed at 0.
  std::size_t first;         ///< Index of its first element among all.
  std::size_t count;
};

inline constexpr std::size_t num_draw_groups = 13;
inline constexpr std::size_t num_drawn = 61;

/// The violation of the equivalence principle, which a campaign has on purpose or not at all: texts
/// of campaigns leave its law out where it is the nominal one.
inline constexpr std::string_view eotvos_parameter_group = "eotvos_parameter";
inline constexpr std::size_t index_of_eotvos_parameter = num_drawn - 1;

/// The groups in file order; together they cover all drawn quantities once.
[[nodiscard]] const std::array<DrawGroup, num_draw_groups>& draw_groups();

/// The group of that name.
/// @pre There is one.
[[nodiscard]] const DrawGroup& draw_group(std::string_view name);

/// Names of all drawn quantities: `scale_factor_error.sensor_1_x`. The name is that of the random
/// stream, so it must never change.
[[nodiscard]] const std::array<std::string, num_drawn>& drawn_names();

/// A value for each drawn quantity, indexed like drawn_names().
using DrawnValues = std::array<double, num_drawn>;
using DispersionSet = std::array<Dispersion, num_drawn>;

/// @param dispersions  Outlive it.
[[nodiscard]] LawSet law_set(const DispersionSet& dispersions);

/// Uniform laws inside the construction bounds of MICROSCOPE, and no violation of the equivalence
/// principle.
[[nodiscard]] DispersionSet nominal_dispersions();

/// As draw_values() of any laws.
[[nodiscard]] DrawnValues draw_values(const DispersionSet& dispersions, std::uint64_t seed,
                                      RunIndex run, std::uint32_t draw,
                                      std::span<const double> table_values,
                                      const SamplingDesign& design = {});

/// Unit of a drawn quantity, for people: `rad`, `m`, `s²/m`, `m/s²`, `rad/s²` or `1`.
/// @param quantity  Index into drawn_names().
[[nodiscard]] std::string_view drawn_unit(std::size_t quantity);

/// Largest magnitude that a drawn quantity may have, in its unit: 1,000 times the bound of its
/// nominal law, far beyond any instrument and wide enough for any experiment with the model. An
/// offcentring of 5 m is a slip of the pen.
///
/// @param quantity  Its place in drawn_names().
[[nodiscard]] double drawn_magnitude_max(std::size_t quantity);

/// Whether expressions gave numbers of such magnitudes; a quotient or a root may give none. A draw
/// that is not in range is taken again.
[[nodiscard]] bool is_drawn_in_range(const DispersionSet& dispersions, const DrawnValues& values);

}  // namespace proofmass
