#pragma once

#include <Eigen/Core>
#include <array>

#include "core/microscope/campaign/drawn_quantities.hpp"
#include "core/microscope/campaign/parameter.hpp"

namespace proofmass {

/// One electrostatic sensor with its test mass. Vectors are x, y, z.
struct Sensor {
  Eigen::Vector3d scale_factor;          ///< K1.
  Eigen::Vector3d misalignment_SK_rad;   ///< θ: small rotation from S to the sensor frame.
  Eigen::Vector3d coupling_rad;          ///< η: defect of orthogonality.
  Eigen::Vector3d quadratic_s2_m;        ///< K2.
  Eigen::Vector3d read_out_bias_K_m_s2;  ///< b0.
  Eigen::Vector3d parasitic_K_m_s2;      ///< p = F_Pa/m.

  /// [K1] + [η].
  [[nodiscard]] Eigen::Matrix3d symmetric_part() const;
  /// [θ] = 1 + [dθ], the rotation from S to the sensor frame at first order.
  [[nodiscard]] Eigen::Matrix3d alignment_KS() const;
  /// [M], exactly as printed after [Hardy2013] eq:measurement.
  [[nodiscard]] Eigen::Matrix3d sensitivity_KS() const;
};

/// One drawn satellite and instrument: everything that differs between two runs except noise.
struct Instrument {
  std::array<Sensor, 2> sensors;      ///< Inner mass (1), outer mass (2).
  Eigen::Vector3d offcentring_S_m;    ///< Δ = O₁O₂.
  Eigen::Vector3d centre_offset_S_m;  ///< r_c: from the satellite's centre of mass to the middle.
  Eigen::Vector3d angular_bias_S_rad_s2;  ///< Of the measured angular acceleration.
  Eigen::Matrix3d thrust_matrix;          ///< [M_DF].
  std::array<Eigen::Vector3d, 2> star_tracker_bias_S_rad;  ///< Of each head, in S.
};

[[nodiscard]] Instrument make_instrument(const DrawnValues& values);

/// [A_c] = [M_c] − [M_d][M_c]⁻¹[M_d] and [A_d] = [M_d][M_c]⁻¹ ([Hardy2013] after eq:Gamma-mesdx).
struct SensitivityMatrices {
  Eigen::Matrix3d common;        ///< A_c.
  Eigen::Matrix3d differential;  ///< A_d.
};

[[nodiscard]] SensitivityMatrices sensitivity_matrices(const Instrument& instrument);

/// True values of the ten parameters, from exact matrices.
///
/// a_d11' = a_d11 + 2(K2c/K1c) b_1d + 2(K2d/K1c)(C_0x − b_0c,x) ([Hardy2013] section 4.2), with
/// b_1d = −½(p_1 − p_2) along X.
/// @param bias_error_x_m_s2  C_0x − b_0c,x: error of the read-out bias that the loop subtracts.
[[nodiscard]] ParameterArray true_parameters(const Instrument& instrument,
                                             double bias_error_x_m_s2);

}  // namespace proofmass
