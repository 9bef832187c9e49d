#include "core/estimation/calibration.hpp"

#include <cmath>
#include <complex>
#include <optional>

namespace proofmass {
namespace {

using Complex = std::complex<double>;

/// One amplitude for each line.
using Lines = std::array<Complex, num_fit_lines_max>;

/// Estimates of a round, with the two slopes behind K2c.
struct Estimates {
  ParameterArray value{};
  std::array<double, 2> slope{};  ///< K21/K11² and K22/K12² as fitted.

  double operator[](Parameter parameter) const { return value[index(parameter)]; }
  double& operator[](Parameter parameter) { return value[index(parameter)]; }
};

/// A parameter that multiplies a signal in Γ_mes,dx ([Hardy2013] eq:Gamma-mesdx).
struct Term {
  Signal signal;
  Parameter parameter;
  double factor;
  SessionTarget own;  ///< The session that estimates it and so keeps it.
};

constexpr std::array<Term, 6> first_order_terms{{
    {Signal::common_x, Parameter::a_d11_prime, 1.0, SessionTarget::a_d11_prime},
    {Signal::common_y, Parameter::a_d12, 1.0, SessionTarget::a_d12},
    {Signal::common_z, Parameter::a_d13, 1.0, SessionTarget::a_d13},
    {Signal::gradient_xx, Parameter::a_c11_delta_x, 0.5, SessionTarget::a_c11_delta_x},
    {Signal::gradient_xy, Parameter::a_c11_delta_y, 0.5, SessionTarget::a_c11_delta_y},
    {Signal::gradient_xz, Parameter::a_c11_delta_z, 0.5, SessionTarget::a_c11_delta_z},
}};

/// ½ a_c12 [T − In]_yj Δ_j or ½ a_c13 [T − In]_zj Δ_j.
struct ProductTerm {
  Signal signal;
  Parameter misalignment;
  Parameter offcentring;
};

constexpr std::array<ProductTerm, 6> second_order_terms{{
    {Signal::gradient_yx, Parameter::a_c12, Parameter::a_c11_delta_x},
    {Signal::gradient_yy, Parameter::a_c12, Parameter::a_c11_delta_y},
    {Signal::gradient_yz, Parameter::a_c12, Parameter::a_c11_delta_z},
    {Signal::gradient_zx, Parameter::a_c13, Parameter::a_c11_delta_x},
    {Signal::gradient_zy, Parameter::a_c13, Parameter::a_c11_delta_y},
    {Signal::gradient_zz, Parameter::a_c13, Parameter::a_c11_delta_z},
}};

/// The one product that `hardy2013` subtracts in a session: ½ â_c13 T̂_zz Δ̂_z for Δx as printed
/// in [Hardy2013] 5.2; for Δz and Δy the product whose gradient shares line and phase with the
/// session's own. The paper's Δ̂ is the estimate of a_c11Δ here: nothing estimates a_c11, which
/// is 1 to 1 %.
std::optional<ProductTerm> printed_product(SessionTarget target) {
  switch (target) {
    case SessionTarget::a_c11_delta_x:
      return ProductTerm{Signal::gradient_zz, Parameter::a_c13, Parameter::a_c11_delta_z};
    case SessionTarget::a_c11_delta_z:
      return ProductTerm{Signal::gradient_zx, Parameter::a_c13, Parameter::a_c11_delta_x};
    case SessionTarget::a_c11_delta_y:
      return ProductTerm{Signal::gradient_yx, Parameter::a_c12, Parameter::a_c11_delta_x};
    default:
      return std::nullopt;
  }
}

bool is_offcentring(SessionTarget target) {
  return target == SessionTarget::a_c11_delta_x || target == SessionTarget::a_c11_delta_y ||
         target == SessionTarget::a_c11_delta_z;
}

const SessionPhasors& phasors_of(const CalibrationRecord& record, SessionTarget target) {
  return record[index(target)];
}

/// Γ_mes,dx less all that is known of it, except what the session is there to find.
Lines corrected_signal(const SessionPhasors& phasors, SessionTarget target, Correction correction,
                       const Estimates& known) {
  Lines lines = phasors.amplitude[index(Signal::differential_x)];
  const auto subtract = [&](Signal signal, double factor) {
    for (std::size_t i = 0; i < phasors.num_lines; ++i) {
      lines[i] -= factor * phasors.amplitude[index(signal)][i];
    }
  };
  const auto subtract_product = [&](const ProductTerm& term) {
    subtract(term.signal, 0.5 * known[term.misalignment] * known[term.offcentring]);
  };
  for (const Term& term : first_order_terms) {
    if (term.own != target) subtract(term.signal, term.factor * known[term.parameter]);
  }
  if (correction == Correction::hardy2013) {
    if (const auto product = printed_product(target)) subtract_product(*product);
  }
  if (correction == Correction::second_order && is_offcentring(target)) {
    for (const ProductTerm& term : second_order_terms) subtract_product(term);
  }
  return lines;
}

/// Real slope p that minimises Σ |signal − p·regressor|² over the lines: only the regressor's phase
/// counts.
double slope(const Lines& signal, const SessionPhasors& phasors, Signal regressor) {
  double product = 0.0;
  double square = 0.0;
  for (std::size_t i = 0; i < phasors.num_lines; ++i) {
    const Complex r = phasors.amplitude[index(regressor)][i];
    product += r.real() * signal[i].real() + r.imag() * signal[i].imag();
    square += r.real() * r.real() + r.imag() * r.imag();
  }
  return product / square;
}

/// Estimates everything once from what the round before knows.
class Round {
 public:
  Round(const CalibrationRecord& record, Correction correction, const Estimates& known)
      : record_(record), correction_(correction), known_(known) {}

  [[nodiscard]] Estimates estimates() const {
    using enum Parameter;
    Estimates next;
    // Γ_mes,dx = ½ [T − In]_xj a_c11 Δ_j
    next[a_c11_delta_x] = 2.0 * fit(SessionTarget::a_c11_delta_x, Signal::gradient_xx);
    next[a_c11_delta_z] = 2.0 * fit(SessionTarget::a_c11_delta_z, Signal::gradient_xz);
    next[a_c11_delta_y] = 2.0 * fit(SessionTarget::a_c11_delta_y, Signal::gradient_xy);
    // Γ_mes,dx = a_c1j · ½([T]_jj − [T]_xx) Δ_TM sin(2π f_TM t): the masses move along sensor axes.
    next[a_c12] = fit(SessionTarget::a_c12, Signal::regressor);
    next[a_c13] = fit(SessionTarget::a_c13, Signal::regressor);
    // Γ_mes,dx = a_d1j Γ_mes,cj
    next[a_d11_prime] = fit(SessionTarget::a_d11_prime, Signal::common_x);
    next[a_d12] = fit(SessionTarget::a_d12, Signal::common_y);
    next[a_d13] = fit(SessionTarget::a_d13, Signal::common_z);
    next[k2d] = differential_quadratic();
    // 2 Γ_mes,dx = ±(K2k/K1k²) Γ_mes,kx² for the mass that moves.
    next.slope = {2.0 * fit(SessionTarget::k2_sensor_1, Signal::regressor),
                  -2.0 * fit(SessionTarget::k2_sensor_2, Signal::regressor)};
    next[k2c] = common_quadratic(next.slope);
    return next;
  }

 private:
  [[nodiscard]] double fit(SessionTarget target, Signal regressor) const {
    const SessionPhasors& phasors = phasors_of(record_, target);
    return slope(corrected_signal(phasors, target, correction_, known_), phasors, regressor);
  }

  /// With mes_c = K1c g + K2c g² and mes_d = K1d g + K2d g², the slope of mes_d against mes_c²
  /// after a_d11 mes_c is taken away is (K2d − a_d11 K2c)/K1c².
  [[nodiscard]] double differential_quadratic() const {
    const double fitted = fit(SessionTarget::k2d, Signal::regressor);
    if (correction_ != Correction::second_order) return fitted;
    return fitted + known_[Parameter::a_d11_prime] * known_[Parameter::k2c];
  }

  /// The slope s_1 is (1 − a) K21/K11² with K11 = K1c (1 + a), a = a_d11; s_2 likewise with −a.
  [[nodiscard]] double common_quadratic(const std::array<double, 2>& s) const {
    if (correction_ != Correction::second_order) return 0.5 * (s[0] + s[1]);
    const double a = known_[Parameter::a_d11_prime];
    return 0.5 *
           (s[0] * (1.0 + a) * (1.0 + a) / (1.0 - a) + s[1] * (1.0 - a) * (1.0 - a) / (1.0 + a));
  }

  const CalibrationRecord& record_;
  Correction correction_;
  const Estimates& known_;
};

bool has_settled(const Estimates& before, const Estimates& after, double convergence,
                 const ParameterArray& objectives) {
  for (std::size_t i = 0; i < num_parameters; ++i) {
    // Written so that a value that is not finite has not settled.
    if (!(std::abs(after.value[i] - before.value[i]) <= convergence * objectives[i])) return false;
  }
  return true;
}

}  // namespace

CalibrationResult calibrate_hardy2013(const CalibrationRecord& record,
                                      const EstimationConfig& config,
                                      const ParameterArray& objectives) {
  Estimates known;
  CalibrationResult result;
  while (!result.converged && result.num_rounds < config.num_rounds_max) {
    const Estimates next = Round(record, config.correction, known).estimates();
    result.converged = has_settled(known, next, config.convergence, objectives);
    known = next;
    ++result.num_rounds;
  }
  result.estimate = known.value;
  return result;
}

}  // namespace proofmass
