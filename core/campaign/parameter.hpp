#pragma once

#include <array>
#include <cstddef>
#include <string_view>

namespace proofmass {

/// The ten instrument parameters that a calibration estimates ([Hardy2013] tab:perfo-numerical),
/// in the order of the paper's table.
enum class Parameter {
  a_c11_delta_x,  ///< a_c11·Δx, m.
  a_c11_delta_z,  ///< a_c11·Δz, m.
  a_c11_delta_y,  ///< a_c11·Δy, m.
  a_c12,          ///< Common misalignment and coupling X-Y, rad.
  a_c13,          ///< Common misalignment and coupling X-Z, rad.
  a_d11_prime,    ///< Differential scale factor with the biases that act like it, 1.
  a_d12,          ///< Differential misalignment and coupling X-Y, rad.
  a_d13,          ///< Differential misalignment and coupling X-Z, rad.
  k2d,            ///< K2d/K1c², differential quadratic factor, s²/m.
  k2c,            ///< K2c/K1c², common quadratic factor, s²/m.
};

inline constexpr std::size_t num_parameters = 10;

/// One value for each parameter, indexed by `index(parameter)`.
using ParameterArray = std::array<double, num_parameters>;

[[nodiscard]] constexpr std::size_t index(Parameter parameter) {
  return static_cast<std::size_t>(parameter);
}

/// [Hardy2013] tab:perfo-numerical: errors |estimate − truth| of the paper's 100 simulations.
struct PaperAccuracy {
  double worst;
  double mean;
  double standard_deviation;
};

/// What is known of a parameter apart from any run.
struct ParameterInfo {
  Parameter parameter;
  std::string_view name;          ///< In files, SQL and logs: `a_c11_delta_x`.
  std::string_view unit_suffix;   ///< Unit as a name suffix: `_m`, `_rad`, `_s2_m` or empty.
  std::string_view label;         ///< For people: `a_c11·Δx`.
  std::string_view unit;          ///< For people, SI: `m`, `rad`, `s²/m` or `1`.
  double display_scale;           ///< A table shows value / display_scale ...
  std::string_view display_unit;  ///< ... in this unit: `nm`, `1e-4 rad`.
  PaperAccuracy paper;            ///< SI.
};

/// All parameters in enumeration order.
[[nodiscard]] const std::array<ParameterInfo, num_parameters>& parameter_infos();

}  // namespace proofmass
