#pragma once

#include <Eigen/Core>
#include <array>

#include "core/microscope/instrument/instrument.hpp"
#include "core/microscope/session/session.hpp"

namespace proofmass {

// Electrostatic stiffness: where a session moves mass k by q_k in its sensor, the electrodes add a
// force in proportion to q_k, so that along the radial axes Y and Z of K
//
//     p_k(t) = p_k + (k_k/m_k) q_k(t)
//
// in eq:instrument-dynamics and eq:measurement of [Hardy2013]. Γ_mes,k then holds
// −([K1_k] + [η_k]) (k_k/m_k) q_k, and K2 sees Γ_App,k with it.

/// Whether a session moves masses along a radial axis of sensors that have stiffness.
[[nodiscard]] bool feels_stiffness(const SensorConfig& config, const Session& session);

/// What this force makes of the first motion that a session commands, as if the satellite and not
/// the electrodes accelerated the mass: the vector in S, s⁻², that times Δ_TM sin(2π f t) gives
/// [M]⁻¹ · −([K1] + [η]) e_a s k/m. So [M] times it is what the sensor measures.
///
/// @param factor  s of the mass, see MassMotion.
/// @pre feels_stiffness().
[[nodiscard]] Eigen::Vector3d stiffness_direction_S(const Sensor& sensor, double stiffness_s2,
                                                    Axis axis, double factor);

}  // namespace proofmass
