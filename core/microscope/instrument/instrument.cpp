#include "core/microscope/instrument/instrument.hpp"

#include <Eigen/LU>
#include <cmath>
#include <cstddef>
#include <string_view>

#include "core/error.hpp"

namespace proofmass {
namespace {

/// Reads the values of a group one after the other.
class GroupReader {
 public:
  GroupReader(const DrawnValues& values, std::string_view name)
      : values_(values), group_(draw_group(name)) {}

  double scalar() {
    PROOFMASS_EXPECT(num_read_ < group_.count);
    return values_[group_.first + num_read_++];
  }
  Eigen::Vector3d vector() {
    const double x = scalar();
    const double y = scalar();
    const double z = scalar();
    return {x, y, z};
  }

 private:
  const DrawnValues& values_;
  const DrawGroup& group_;
  std::size_t num_read_ = 0;
};

}  // namespace

Eigen::Matrix3d Sensor::symmetric_part() const {
  const Eigen::Vector3d& k = scale_factor;
  const Eigen::Vector3d& eta = coupling_rad;
  Eigen::Matrix3d m;
  m << k.x(), eta.z(), eta.y(),  //
      eta.z(), k.y(), eta.x(),   //
      eta.y(), eta.x(), k.z();
  return m;
}

Eigen::Matrix3d Sensor::alignment_KS() const {
  const Eigen::Vector3d& theta = misalignment_SK_rad;
  Eigen::Matrix3d m;
  m << 1.0, theta.z(), -theta.y(),  //
      -theta.z(), 1.0, theta.x(),   //
      theta.y(), -theta.x(), 1.0;
  return m;
}

Eigen::Matrix3d Sensor::sensitivity_KS() const {
  return symmetric_part() + alignment_KS() - Eigen::Matrix3d::Identity();
}

Instrument make_instrument(const DrawnValues& values) {
  GroupReader scale_factor_error(values, "scale_factor_error");
  GroupReader misalignment(values, "misalignment_rad");
  GroupReader coupling(values, "coupling_rad");
  GroupReader quadratic(values, "quadratic_factor_s2_m");
  GroupReader read_out_bias(values, "read_out_bias_m_s2");
  GroupReader parasitic(values, "parasitic_acceleration_m_s2");
  GroupReader star_tracker_bias(values, "star_tracker_bias_rad");
  Instrument instrument;
  for (std::size_t k = 0; k < 2; ++k) {
    Sensor& sensor = instrument.sensors[k];
    sensor.scale_factor = Eigen::Vector3d::Ones() + scale_factor_error.vector();
    sensor.misalignment_SK_rad = misalignment.vector();
    sensor.coupling_rad = coupling.vector();
    sensor.quadratic_s2_m = quadratic.vector();
    sensor.read_out_bias_K_m_s2 = read_out_bias.vector();
    sensor.parasitic_K_m_s2 = parasitic.vector();
    instrument.star_tracker_bias_S_rad[k] = star_tracker_bias.vector();
  }
  instrument.offcentring_S_m = GroupReader(values, "offcentring_m").vector();
  instrument.centre_offset_S_m = GroupReader(values, "centre_of_mass_offset_m").vector();
  instrument.angular_bias_S_rad_s2 = GroupReader(values, "angular_bias_rad_s2").vector();

  const Eigen::Vector3d thrust = GroupReader(values, "thruster_scale_error").vector();
  GroupReader thrust_coupling(values, "thruster_coupling_rad");  // xy xz yx yz zx zy
  for (Eigen::Index row = 0; row < 3; ++row) {
    for (Eigen::Index column = 0; column < 3; ++column) {
      instrument.thrust_matrix(row, column) =
          row == column ? 1.0 + thrust[row] : thrust_coupling.scalar();
    }
  }
  instrument.eotvos_parameter = GroupReader(values, eotvos_parameter_group).scalar();
  return instrument;
}

SensitivityMatrices sensitivity_matrices(const Instrument& instrument) {
  const Eigen::Matrix3d m1 = instrument.sensors[0].sensitivity_KS();
  const Eigen::Matrix3d m2 = instrument.sensors[1].sensitivity_KS();
  const Eigen::Matrix3d common = 0.5 * (m1 + m2);
  const Eigen::Matrix3d difference = 0.5 * (m1 - m2);
  const Eigen::Matrix3d ratio = difference * common.inverse();
  return {.common = common - ratio * difference, .differential = ratio};
}

bool is_accepted(const Instrument& instrument, const AcceptanceConfig& acceptance) {
  const auto [a_c, a_d] = sensitivity_matrices(instrument);
  return std::abs(a_d(0, 0)) <= acceptance.a_d11_max &&
         std::abs(a_d(0, 1)) <= acceptance.a_d1j_max_rad &&
         std::abs(a_d(0, 2)) <= acceptance.a_d1j_max_rad &&
         std::abs(a_c(0, 1)) <= acceptance.a_c1j_max_rad &&
         std::abs(a_c(0, 2)) <= acceptance.a_c1j_max_rad;
}

double differential_bias_x(const Instrument& instrument) {
  return -0.5 *
         (instrument.sensors[0].parasitic_K_m_s2.x() - instrument.sensors[1].parasitic_K_m_s2.x());
}

ParameterArray true_parameters(const Instrument& instrument, double common_offset_x_m_s2) {
  const auto [a_c, a_d] = sensitivity_matrices(instrument);
  const Sensor& inner = instrument.sensors[0];
  const Sensor& outer = instrument.sensors[1];
  const double k1c = 0.5 * (inner.scale_factor.x() + outer.scale_factor.x());
  const double k2c = 0.5 * (inner.quadratic_s2_m.x() + outer.quadratic_s2_m.x());
  const double k2d = 0.5 * (inner.quadratic_s2_m.x() - outer.quadratic_s2_m.x());
  const double b1d = differential_bias_x(instrument);

  ParameterArray truth{};
  const auto at = [&truth](Parameter parameter) -> double& { return truth[index(parameter)]; };
  at(Parameter::a_c11_delta_x) = a_c(0, 0) * instrument.offcentring_S_m.x();
  at(Parameter::a_c11_delta_z) = a_c(0, 0) * instrument.offcentring_S_m.z();
  at(Parameter::a_c11_delta_y) = a_c(0, 0) * instrument.offcentring_S_m.y();
  at(Parameter::a_c12) = a_c(0, 1);
  at(Parameter::a_c13) = a_c(0, 2);
  at(Parameter::a_d11_prime) =
      a_d(0, 0) + 2.0 * (k2c / k1c) * b1d + 2.0 * (k2d / k1c) * common_offset_x_m_s2;
  at(Parameter::a_d12) = a_d(0, 1);
  at(Parameter::a_d13) = a_d(0, 2);
  at(Parameter::k2d) = k2d / (k1c * k1c);
  at(Parameter::k2c) = k2c / (k1c * k1c);
  return truth;
}

}  // namespace proofmass
