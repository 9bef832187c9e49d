#include "core/microscope/instrument/wire_noise.hpp"

#include <numbers>

namespace proofmass {

double wire_noise_level(const WireConfig& wire, std::size_t sensor) {
  constexpr double boltzmann_j_k = 1.380649e-23;
  const double amplitude = wire.factor[sensor] / wire.mass_kg[sensor];
  return amplitude * amplitude * 4.0 * boltzmann_j_k * wire.temperature_k * wire.damping_n_m /
         (2.0 * std::numbers::pi);
}

}  // namespace proofmass
