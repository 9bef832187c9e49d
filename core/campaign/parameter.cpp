#include "core/campaign/parameter.hpp"

namespace proofmass {

const std::array<ParameterInfo, num_parameters>& parameter_infos() {
  using enum Parameter;
  // Last column: [Hardy2013] tab:perfo-numerical, worst / mean / standard deviation.
  static constexpr std::array<ParameterInfo, num_parameters> infos{{
      {a_c11_delta_x,
       "a_c11_delta_x",
       "_m",
       "a_c11·Δx",
       "m",
       1e-9,
       "nm",
       {0.04e-6, 0.01e-6, 7.3e-9}},
      {a_c11_delta_z,
       "a_c11_delta_z",
       "_m",
       "a_c11·Δz",
       "m",
       1e-9,
       "nm",
       {0.05e-6, 0.03e-6, 6.5e-9}},
      {a_c11_delta_y,
       "a_c11_delta_y",
       "_m",
       "a_c11·Δy",
       "m",
       1e-9,
       "nm",
       {0.2e-6, 0.05e-6, 0.04e-6}},
      {a_c12, "a_c12", "_rad", "a_c12", "rad", 1e-4, "1e-4 rad", {1.0e-3, 2.6e-4, 2.3e-4}},
      {a_c13, "a_c13", "_rad", "a_c13", "rad", 1e-4, "1e-4 rad", {1.1e-3, 3.1e-4, 2.6e-4}},
      {a_d11_prime, "a_d11_prime", "", "a_d11'", "1", 1e-6, "1e-6", {5e-6, 1.6e-6, 1.2e-6}},
      {a_d12, "a_d12", "_rad", "a_d12", "rad", 1e-6, "1e-6 rad", {2e-5, 1.2e-6, 1.7e-6}},
      {a_d13, "a_d13", "_rad", "a_d13", "rad", 1e-6, "1e-6 rad", {4e-6, 1.0e-6, 8.3e-7}},
      {k2d, "k2d", "_s2_m", "K2d/K1c²", "s²/m", 1.0, "s²/m", {124, 25, 23}},
      {k2c, "k2c", "_s2_m", "K2c/K1c²", "s²/m", 1.0, "s²/m", {274, 62, 54}},
  }};
  return infos;
}

}  // namespace proofmass
