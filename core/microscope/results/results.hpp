#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "core/campaign/run_result.hpp"

namespace proofmass {

// What a run of a MICROSCOPE campaign yields: the ten parameters and, in health.hpp, how well the
// loops held and why a run may be lost. microscope_results() describes all of it to whatever runs
// campaigns.

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

/// What the sessions that test the equivalence principle find: in the results of campaigns that
/// have such sessions these quantities follow the ten.
enum class TestParameter {
  eotvos_parameter,  ///< δ = m_g2/m_I2 − m_g1/m_I1, 1.
  a_c11_delta_x,     ///< a_c11·Δx by the test's own line at 2 f_EP, m.
  a_c11_delta_z,     ///< a_c11·Δz by that line, m.
  uncorrected,       ///< δ of the same tests without any calibration, 1.
};

inline constexpr std::size_t num_test_parameters = 4;
/// The first that many have an objective. That of the fourth shows what the calibration is worth.
inline constexpr std::size_t num_test_objectives = 3;

/// One value for each, indexed by `index(parameter)`.
using TestArray = std::array<double, num_test_parameters>;

[[nodiscard]] constexpr std::size_t index(TestParameter parameter) {
  return static_cast<std::size_t>(parameter);
}

/// Most draws of one run; with the nominal laws three of four are accepted. A run that needs more
/// ends as RunStatus::no_draw.
inline constexpr std::uint32_t num_draws_max = 1000;

/// What the results of a MICROSCOPE campaign are: the parameters in enumeration order, the numbers
/// of a LoopHealth, the causes of a Loss, and the targets of sessions as the places where a run may
/// be lost.
[[nodiscard]] const ResultSchema& microscope_results();

/// The quantities of a test, in enumeration order; the first has a standard error.
[[nodiscard]] const std::array<Quantity, num_test_parameters>& test_quantities();

}  // namespace proofmass
