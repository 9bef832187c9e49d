#pragma once

#include <Eigen/Core>
#include <array>

#include "core/microscope/instrument/drawn_quantities.hpp"
#include "core/microscope/instrument/instrument_config.hpp"
#include "core/microscope/results/results.hpp"

namespace proofmass {

/// One electrostatic sensor with its test mass, as drawn for a run. K is the sensor's frame. The
/// triples K1, η and K2 belong to its axes; they are no vectors and have no frame in their names.
struct Sensor {
  Eigen::Vector3d scale_factor;          ///< K1 of each axis, near 1.
  Eigen::Vector3d misalignment_SK_rad;   ///< θ: rotation vector from S to K, small.
  Eigen::Vector3d coupling_rad;          ///< η: defect of orthogonality, of the planes yz, xz, xy.
  Eigen::Vector3d quadratic_s2_m;        ///< K2 of each axis.
  Eigen::Vector3d read_out_bias_K_m_s2;  ///< b0.
  Eigen::Vector3d parasitic_K_m_s2;      ///< p = F_Pa/m, the paper's b1.

  /// [K1] + [η], symmetric: what the electrostatic measurement makes of a force in K.
  [[nodiscard]] Eigen::Matrix3d symmetric_part() const;
  /// [θ] = 1 + [dθ], at first order the rotation v_K = [θ] v_S.
  [[nodiscard]] Eigen::Matrix3d alignment_KS() const;
  /// [M], exactly as printed after [Hardy2013] eq:measurement: first order in the angles.
  [[nodiscard]] Eigen::Matrix3d sensitivity_KS() const;
};

/// One drawn satellite and instrument: everything that differs between two runs except noise.
struct Instrument {
  std::array<Sensor, 2> sensors;          ///< Inner mass (1), outer mass (2).
  Eigen::Vector3d offcentring_S_m;        ///< Δ = O₁O₂, from mass 1 to mass 2.
  Eigen::Vector3d centre_offset_S_m;      ///< r_c: from O_sat to the middle of O₁ and O₂.
  Eigen::Vector3d angular_bias_S_rad_s2;  ///< Of the measured angular acceleration.
  Eigen::Matrix3d thrust_matrix;          ///< [M_DF]: acceleration in S for a command in S.
  std::array<Eigen::Vector3d, 2> star_tracker_bias_S_rad;  ///< Of each head, a rotation vector.
  /// δ = m_g2/m_I2 − m_g1/m_I1 ([Hardy2013] section 3.2): gravitational over inertial mass.
  double eotvos_parameter = 0.0;
};

/// The instrument of a draw, whether or not it lies inside the acceptance bounds.
[[nodiscard]] Instrument make_instrument(const DrawnValues& values);

/// Common and differential sensitivity ([Hardy2013] after eq:Gamma-mesdx), with
/// M_c = ½(M_1 + M_2) and M_d = ½(M_1 − M_2):
///
///     A_c = M_c − M_d M_c⁻¹ M_d        A_d = M_d M_c⁻¹
///
/// They satisfy Γ_mes,d = A_d Γ_mes,c + A_c Γ_App,d for linear sensors.
struct SensitivityMatrices {
  Eigen::Matrix3d common;        ///< A_c, near 1; multiplies components in S.
  Eigen::Matrix3d differential;  ///< A_d, 1e-2 at most; multiplies measured components.
};

[[nodiscard]] SensitivityMatrices sensitivity_matrices(const Instrument& instrument);

/// True if |a_d11|, |a_d12|, |a_d13|, |a_c12| and |a_c13| are at most their bounds, those behind
/// [Hardy2013] tab:Budget.
[[nodiscard]] bool is_accepted(const Instrument& instrument, const AcceptanceConfig& acceptance);

/// True values of the ten parameters, SI, from exact matrices.
///
/// a_d11' = a_d11 + 2(K2c/K1c) b_1d + 2(K2d/K1c)(C_0x − b_0c,x) ([Hardy2013] section 4.2), with
/// b_1d = differential_bias_x() along X.
/// @param common_offset_x_m_s2  C_0x − b_0c,x: constant of Γ_App,cx that the loop leaves.
[[nodiscard]] ParameterArray true_parameters(const Instrument& instrument,
                                             double common_offset_x_m_s2);

/// b_1d = −½(p_1 − p_2) along X, m/s²: the constant of Γ_App,d.
[[nodiscard]] double differential_bias_x(const Instrument& instrument);

}  // namespace proofmass
