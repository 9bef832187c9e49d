#include "core/microscope/estimation/joint/joint_model.hpp"

#include <algorithm>
#include <array>
#include <numbers>
#include <span>

namespace proofmass {
namespace {

template <typename Function>
Dual chained(double value, const Function& slope_of) {
  Dual result(value);
  for (std::size_t i = 0; i < num_unknowns; ++i) result.slope[i] = slope_of(i);
  return result;
}

Dual operator+(const Dual& a, const Dual& b) {
  return chained(a.value + b.value, [&](std::size_t i) { return a.slope[i] + b.slope[i]; });
}
Dual operator-(const Dual& a, const Dual& b) {
  return chained(a.value - b.value, [&](std::size_t i) { return a.slope[i] - b.slope[i]; });
}
Dual operator*(const Dual& a, const Dual& b) {
  return chained(a.value * b.value,
                 [&](std::size_t i) { return a.slope[i] * b.value + a.value * b.slope[i]; });
}
Dual operator/(const Dual& a, const Dual& b) {
  const double quotient = a.value / b.value;
  return chained(quotient,
                 [&](std::size_t i) { return (a.slope[i] - quotient * b.slope[i]) / b.value; });
}

using Vector = std::array<Dual, 3>;
using Matrix = std::array<Dual, 9>;  ///< Row by row.

/// The unknowns, each with the derivative 1 by itself.
class Unknowns {
 public:
  explicit Unknowns(const UnknownArray& values) : values_(values) {}

  Dual operator[](Parameter parameter) const { return at(index(parameter)); }
  Dual operator[](Unknown unknown) const { return at(index(unknown)); }

  [[nodiscard]] Vector offcentring() const {
    return {at(index(Parameter::a_c11_delta_x)), at(index(Parameter::a_c11_delta_y)),
            at(index(Parameter::a_c11_delta_z))};
  }

 private:
  [[nodiscard]] Dual at(std::size_t i) const {
    Dual dual(values_[i]);
    dual.slope[i] = 1.0;
    return dual;
  }
  const UnknownArray& values_;
};

/// What the symmetric part of G makes of w: that of the angular acceleration is taken out.
Matrix symmetric(const Matrix& w) {
  Matrix result;
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      result[3 * i + j] = Dual(0.5) * (w[3 * i + j] + w[3 * j + i]);
    }
  }
  return result;
}

/// w_ij = gain_i v_j, and what the tilt β makes of it: with S the symmetric part of G and B v = β∧v
/// the signal is Σ w_ij (G + B S + (B S)ᵀ)_ij = Σ (w_ij + [Bᵀ(w + wᵀ)]_ij, made symmetric) G_ij.
Matrix tilted_product(const Vector& gain, const Vector& v, const Unknowns& x) {
  Matrix w;
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) w[3 * i + j] = gain[i] * v[j];
  }
  const Dual zero(0.0);
  const Dual tx = x[Unknown::tilt_x], ty = x[Unknown::tilt_y], tz = x[Unknown::tilt_z];
  const Matrix turn{zero, zero - tz, ty, tz, zero, zero - tx, zero - ty, tx, zero};
  Matrix turned;
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      for (std::size_t m = 0; m < 3; ++m) {
        turned[3 * i + j] = turned[3 * i + j] + turn[3 * m + i] * (w[3 * m + j] + w[3 * j + m]);
      }
    }
  }
  Matrix sum = symmetric(turned);
  for (std::size_t i = 0; i < sum.size(); ++i) sum[i] = w[i] + sum[i];
  return sum;
}

/// Constant part c₀ of the common acceleration that the drag-free loop leaves.
Dual common_constant(DragFreeSource source, const Dual& a, const Dual& b, const Unknowns& x) {
  const Dual cross =
      x[Parameter::a_c12] * x[Unknown::parasitic_y] + x[Parameter::a_c13] * x[Unknown::parasitic_z];
  switch (source) {
    case DragFreeSource::sensor_1:
      return Dual(0.0) - b - cross;
    case DragFreeSource::sensor_2:
      return b - cross;
    case DragFreeSource::common:
      break;
  }
  return Dual(0.0) - a * b - cross;
}

/// a_d11' less a_d11: 2(K2c Γ_d + K2d Γ_c)/K1c with the constants Γ_d = b_1d and Γ_c of the loop.
Dual constant_part(DragFreeSource found, const Unknowns& x) {
  Dual factor = x[Parameter::k2c];
  if (found == DragFreeSource::sensor_1) factor = factor - x[Parameter::k2d];
  if (found == DragFreeSource::sensor_2) factor = factor + x[Parameter::k2d];
  return Dual(2.0) * factor * x[Unknown::differential_bias];
}

/// Direction e of a relative motion in S: a row of [θ_c].
Vector motion_direction(const Excitation& excitation, const Unknowns& x) {
  if (excitation.axis == Axis::x) return {1.0, 0.0, 0.0};
  if (excitation.axis == Axis::y) {
    return {x[Unknown::coupling_z] - x[Parameter::a_c12], 1.0, x[Unknown::alignment_x]};
  }
  return {x[Unknown::coupling_y] - x[Parameter::a_c13], Dual(0.0) - x[Unknown::alignment_x], 1.0};
}

/// What multiplies the line of [T̂ − În]_xx at low frequency, while one mass moves along X.
Dual rectified_gradient(const Session& session, const Dual& k2_1, const Dual& k2_2) {
  const Excitation* const excitation = mass_excitation(session);
  if (excitation == nullptr || excitation->axis != Axis::x ||
      excitation->motion == MassMotion::opposition) {
    return 0.0;
  }
  const double speed_m_s =
      2.0 * std::numbers::pi * excitation->frequency_hz * excitation->amplitude;
  const Dual half_square(0.5 * speed_m_s * speed_m_s);
  return excitation->motion == MassMotion::mass_1 ? half_square * k2_1
                                                  : Dual(0.0) - half_square * k2_2;
}

Dual constant_of(const std::array<double, num_line_bases>& means, const Unknowns& x) {
  const Vector offcentring = x.offcentring();
  Dual b = x[Unknown::differential_bias];
  for (std::size_t j = 0; j < 3; ++j) {
    b = b + Dual(0.5 * means[index(Signal::gradient_xx) + j]) * offcentring[j];
  }
  return b;
}

}  // namespace

std::string_view name_of(Unknown nuisance) {
  static constexpr std::array<std::string_view, num_unknowns - num_parameters> names{
      "the common scale factor along X",
      "the common coupling about Z",
      "the common coupling about Y",
      "the common misalignment about X",
      "the bias of the star tracker about X",
      "the bias of the star tracker about Y",
      "the bias of the star tracker about Z",
      "the differential parasitic acceleration along X",
      "the common parasitic acceleration along Y",
      "the common parasitic acceleration along Z",
      "the differential quadratic factor along Y",
      "the differential quadratic factor along Z",
      "the common quadratic factor along Y",
      "the common quadratic factor along Z",
  };
  return names.at(index(nuisance) - num_parameters);
}

UnknownArray true_unknowns(const Instrument& instrument, double common_offset_x_m_s2) {
  const ParameterArray parameters = true_parameters(instrument, common_offset_x_m_s2);
  const auto& [one, two] = instrument.sensors;
  const Eigen::Vector3d k1 = 0.5 * (one.scale_factor + two.scale_factor);
  const Eigen::Vector3d p = 0.5 * (one.parasitic_K_m_s2 + two.parasitic_K_m_s2);
  const Eigen::Vector3d b = -0.5 * (one.parasitic_K_m_s2 - two.parasitic_K_m_s2);
  const Eigen::Vector3d k2d = 0.5 * (one.quadratic_s2_m - two.quadratic_s2_m);
  UnknownArray unknowns{};
  std::copy(parameters.begin(), parameters.end(), unknowns.begin());
  const auto at = [&](Unknown unknown) -> double& { return unknowns[index(unknown)]; };
  at(Unknown::motion_gain) = sensitivity_matrices(instrument).common(0, 0) - 1.0;
  at(Unknown::coupling_z) = 0.5 * (one.coupling_rad.z() + two.coupling_rad.z());
  at(Unknown::coupling_y) = 0.5 * (one.coupling_rad.y() + two.coupling_rad.y());
  at(Unknown::alignment_x) = 0.5 * (one.misalignment_SK_rad.x() + two.misalignment_SK_rad.x());
  at(Unknown::differential_bias) = k1.x() * b.x();
  at(Unknown::parasitic_y) = k1.x() * p.y();
  at(Unknown::parasitic_z) = k1.x() * p.z();
  at(Unknown::scale_y) = 2.0 * k2d.y() * b.y() / k1.y();
  at(Unknown::scale_z) = 2.0 * k2d.z() * b.z() / k1.z();
  const Eigen::Vector3d k2c = 0.5 * (one.quadratic_s2_m + two.quadratic_s2_m);
  at(Unknown::square_y) = k2c.y() * k2c.y();
  at(Unknown::square_z) = k2c.z() * k2c.z();
  return unknowns;
}

Dual mean_differential(const std::array<double, num_line_bases>& means,
                       const UnknownArray& unknowns, double mean_square_m2_s4) {
  const Unknowns x(unknowns);
  return constant_of(means, x) + x[Parameter::k2d] * Dual(mean_square_m2_s4);
}

LineCoefficients line_coefficients(const Session& session,
                                   const std::array<double, num_line_bases>& means,
                                   const UnknownArray& unknowns, DragFreeSource found) {
  const Unknowns x(unknowns);
  const Dual one(1.0), two(2.0), half(0.5);
  const Dual k2c = x[Parameter::k2c], k2d = x[Parameter::k2d];
  const Dual k2_1 = k2c + k2d, k2_2 = k2c - k2d;
  const Dual b = constant_of(means, x);
  const Dual a = x[Parameter::a_d11_prime] - constant_part(found, x);
  const Dual c = common_constant(session.drag_free, a, b, x);

  const Dual kappa = two * (k2d * b + k2c * c);   // Of the common channel's scale.
  const Dual lambda = two * (k2c * b + k2d * c);  // Of the differential one.
  const Dual a_x = (a + lambda) / (one + kappa);
  const auto cross = [&](Parameter a_d, Parameter a_c, Unknown scale) {
    return x[a_d] - lambda * x[a_c] - x[a_d] * x[scale];
  };
  LineCoefficients of;
  of.common = {a_x, cross(Parameter::a_d12, Parameter::a_c12, Unknown::scale_y),
               cross(Parameter::a_d13, Parameter::a_c13, Unknown::scale_z)};

  const Dual scale_1 = one + a + two * k2_1 * (c + b);
  const Dual scale_2 = one - a + two * k2_2 * (c - b);
  of.squares = {half * (one - a_x) * k2_1 / (scale_1 * scale_1),
                Dual(-0.5) * (one + a_x) * k2_2 / (scale_2 * scale_2)};

  const Dual a_c11 = one + x[Unknown::motion_gain];
  const Dual a_c12 = x[Parameter::a_c12], a_c13 = x[Parameter::a_c13];
  Vector half_offcentring = x.offcentring();
  for (Dual& component : half_offcentring) component = half * component;
  of.gradients = tilted_product({one + kappa, a_c12 / a_c11, a_c13 / a_c11}, half_offcentring, x);
  of.gradients[0] = of.gradients[0] + rectified_gradient(session, k2_1, k2_2);
  const MassExcitations motions = mass_excitations(session);
  for (std::size_t i = 0; i < motions.size() && motions[i] != nullptr; ++i) {
    // Coriolis's acceleration cancels that of Ω̇ at these lines.
    of.moved[i] = symmetric(
        tilted_product({a_c11 + kappa, a_c12, a_c13}, motion_direction(*motions[i], x), x));
  }
  return of;
}

Prediction predict(const LineCoefficients& coefficients, LineSignals signals,
                   const LinePhasors& line) {
  Prediction sum;
  const auto add = [&](std::span<const Dual> factors, std::size_t first) {
    for (std::size_t j = 0; j < factors.size(); ++j) sum.add(factors[j], line[first + j]);
  };
  add(coefficients.common, index(Signal::common_x));
  // The first row stands among the signals that every line has, the others behind them.
  const std::span<const Dual> gradients = coefficients.gradients;
  add(signals == LineSignals::gradients ? gradients : gradients.first(3),
      index(Signal::gradient_xx));
  if (signals == LineSignals::squares) add(coefficients.squares, num_line_bases);
  if (signals == LineSignals::moved) add(coefficients.moved[0], num_line_bases);
  if (signals == LineSignals::moved_again) add(coefficients.moved[1], num_line_bases);
  return sum;
}

Prediction push_terms(DragFreeSource source, const UnknownArray& unknowns, const Push& push,
                      PushLine line) {
  Prediction sum;
  const Unknowns x(unknowns);
  const std::complex<double> a = push.at_f, b = push.at_2f;
  const double square = std::norm(a), all_squares = square + 2.0 * push.square_of_others_m2_s4;
  if (push.axis != Axis::x) {
    if (line == PushLine::at_2f) return sum;
    const bool is_y = push.axis == Axis::y;
    sum.add(Dual(1.5) * x[is_y ? Parameter::a_d12 : Parameter::a_d13] *
                x[is_y ? Unknown::square_y : Unknown::square_z],
            all_squares * a);
    return sum;
  }
  const Dual k2c = x[Parameter::k2c];
  const Dual k2 = x[Parameter::k2d] - x[Parameter::a_d11_prime] * k2c;
  // The constant that the half sum has where the loop holds one mass, over |a|².
  Dual level = 0.0;
  if (source == DragFreeSource::sensor_1) level = Dual(-0.5) * x[Parameter::k2d];
  if (source == DragFreeSource::sensor_2) level = Dual(0.5) * x[Parameter::k2d];
  if (line == PushLine::at_f) {
    sum.add(k2, std::conj(a) * b);
    sum.add(k2 * (Dual(2.0) * level - Dual(1.5) * k2c), all_squares * a);
    sum.add(Dual(-8.75) * k2 * k2c * k2c * k2c, square * square * a);
    return sum;
  }
  sum.add(k2 * (Dual(2.0) * level - Dual(5.0) * k2c), square * b);
  sum.add(k2 * k2c * (Dual(4.5) * k2c - Dual(3.0) * level), square * a * a);
  return sum;
}

LinePhasors centred(const LinePhasors& line, const std::array<double, num_line_bases>& means) {
  const std::size_t d = index(Signal::differential_x), c = index(Signal::common_x);
  LinePhasors result = line;
  result[num_line_bases] -= 2.0 * (means[c] + means[d]) * (line[c] + line[d]);
  result[num_line_bases + 1] -= 2.0 * (means[c] - means[d]) * (line[c] - line[d]);
  return result;
}

}  // namespace proofmass
