#include "core/microscope/estimation/hardy2013/hardy2013.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <optional>

#include "core/error.hpp"
#include "core/microscope/session/session.hpp"

namespace proofmass {
namespace {

using Complex = std::complex<double>;

/// One amplitude for each line.
using Lines = std::array<Complex, num_fit_lines_max>;

/// Estimates of a round.
struct Estimates {
  ParameterArray value{};

  double operator[](Parameter parameter) const { return value[index(parameter)]; }
  double& operator[](Parameter parameter) { return value[index(parameter)]; }
};

/// A parameter that multiplies a signal in Γ_mes,dx ([Hardy2013] eq:Gamma-mesdx). A session that is
/// fitted against the signal is there to find the parameter and keeps the term.
struct Term {
  Signal signal;
  Parameter parameter;
  double factor;
};

constexpr std::array<Term, 6> first_order_terms{{
    {Signal::common_x, Parameter::a_d11_prime, 1.0},
    {Signal::common_y, Parameter::a_d12, 1.0},
    {Signal::common_z, Parameter::a_d13, 1.0},
    {Signal::gradient_xx, Parameter::a_c11_delta_x, 0.5},
    {Signal::gradient_xy, Parameter::a_c11_delta_y, 0.5},
    {Signal::gradient_xz, Parameter::a_c11_delta_z, 0.5},
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

/// What the slopes of the sessions are estimates of; the two of K2c apart.
struct Determined {
  SessionTarget target;
  Parameter parameter;
};

constexpr std::array<Determined, 9> determined_parameters{{
    {SessionTarget::a_c11_delta_x, Parameter::a_c11_delta_x},
    {SessionTarget::a_c11_delta_z, Parameter::a_c11_delta_z},
    {SessionTarget::a_c11_delta_y, Parameter::a_c11_delta_y},
    {SessionTarget::a_c12, Parameter::a_c12},
    {SessionTarget::a_c13, Parameter::a_c13},
    {SessionTarget::a_d11_prime, Parameter::a_d11_prime},
    {SessionTarget::a_d12, Parameter::a_d12},
    {SessionTarget::a_d13, Parameter::a_d13},
    {SessionTarget::k2d, Parameter::k2d},
}};

/// Γ_mes,dx less all that is known of it, except what the session is there to find.
Lines corrected_signal(const SessionPhasors& phasors, const TargetInfo& target,
                       Correction correction, const Estimates& known) {
  Lines lines{};
  std::copy_n(phasors.amplitude[index(Signal::differential_x)].begin(), lines.size(),
              lines.begin());
  const auto subtract = [&](Signal signal, double factor) {
    for (std::size_t i = 0; i < phasors.num_fit_lines; ++i) {
      lines[i] -= factor * phasors.amplitude[index(signal)][i];
    }
  };
  const auto subtract_product = [&](const ProductTerm& term) {
    subtract(term.signal, 0.5 * known[term.misalignment] * known[term.offcentring]);
  };
  for (const Term& term : first_order_terms) {
    if (term.signal != target.regressor) subtract(term.signal, term.factor * known[term.parameter]);
  }
  if (correction == Correction::hardy2013) {
    if (const auto product = printed_product(target.target)) subtract_product(*product);
  }
  if (correction == Correction::second_order && target.signals == SignalSet::all) {
    for (const ProductTerm& term : second_order_terms) subtract_product(term);
  }
  return lines;
}

/// Adds up what a least-squares slope is the quotient of.
struct SlopeSums {
  double product = 0.0;
  double square = 0.0;

  /// A session's lines; only what is in phase with the regressor counts.
  void add(const Lines& signal, const SessionPhasors& phasors, Signal regressor, double weight) {
    for (std::size_t i = 0; i < phasors.num_fit_lines; ++i) {
      const Complex r = phasors.amplitude[index(regressor)][i];
      product += weight * (r.real() * signal[i].real() + r.imag() * signal[i].imag());
      square += weight * (r.real() * r.real() + r.imag() * r.imag());
    }
  }
};

/// Calls visit(i, weight) for each session with a target. A phasor's variance is inverse to the
/// session's length, so that is its weight, in that of the first.
template <typename Visitor>
void for_each_session_of(SessionTarget target, const std::vector<Session>& sessions,
                         const Visitor& visit) {
  const Session* first = nullptr;
  for (std::size_t i = 0; i < sessions.size(); ++i) {
    if (sessions[i].target != target) continue;
    if (first == nullptr) first = &sessions[i];
    visit(i, static_cast<double>(sessions[i].num_orbits) / static_cast<double>(first->num_orbits));
  }
}

/// Estimates everything once from what the round before knows.
class Round {
 public:
  Round(const RunPhasors& records, const std::vector<Session>& sessions, Correction correction,
        const Estimates& known)
      : records_(records), sessions_(sessions), correction_(correction), known_(known) {}

  [[nodiscard]] Estimates estimates() const {
    Estimates next;
    for (const auto& [target, parameter] : determined_parameters) next[parameter] = fit(target);
    next[Parameter::k2d] = differential_quadratic(next[Parameter::k2d]);
    next[Parameter::k2c] =
        common_quadratic({fit(SessionTarget::k2_sensor_1), fit(SessionTarget::k2_sensor_2)});
    return next;
  }

 private:
  /// The real slope p that minimises Σ |signal − p·regressor|² over the lines of the target's
  /// sessions, in units of the target.
  [[nodiscard]] double fit(SessionTarget target) const {
    const TargetInfo& info = target_info(target);
    SlopeSums sums;
    for_each_session_of(target, sessions_, [&](std::size_t i, double weight) {
      sums.add(corrected_signal(records_[i], info, correction_, known_), records_[i],
               info.regressor, weight);
    });
    return info.scale * (sums.product / sums.square);
  }

  /// With mes_c = K1c g + K2c g² and mes_d = K1d g + K2d g², the slope of mes_d against mes_c²
  /// after a_d11 mes_c is taken away is (K2d − a_d11 K2c)/K1c².
  [[nodiscard]] double differential_quadratic(double fitted) const {
    if (correction_ != Correction::second_order) return fitted;
    return fitted + known_[Parameter::a_d11_prime] * known_[Parameter::k2c];
  }

  /// The slope s_1 is (1 − a) K21/K11² with K11 = K1c (1 + a), a = a_d11; s_2 is (1 + a) K22/K12²
  /// with K12 = K1c (1 − a).
  [[nodiscard]] double common_quadratic(const std::array<double, 2>& s) const {
    if (correction_ != Correction::second_order) return 0.5 * (s[0] + s[1]);
    const double a = known_[Parameter::a_d11_prime];
    return 0.5 *
           (s[0] * (1.0 + a) * (1.0 + a) / (1.0 - a) + s[1] * (1.0 - a) * (1.0 - a) / (1.0 + a));
  }

  const RunPhasors& records_;
  const std::vector<Session>& sessions_;
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

/// Variance of cosine's and sine's amplitude of Γ_mes,dx at a fit line by the noise of the sensors,
/// behind the band-pass; without noise that of scale 1.
double line_variance(const Session& session, std::size_t line, const EstimationInput& input) {
  const double f = line_frequency_hz(session, session.fit_lines[line], input.orbit_period_s);
  const BandPass filter =
      fit_lines_filter(session, input.config, input.orbit_period_s, input.sample_period_s);
  const double scale = input.noise.scale > 0.0 ? input.noise.scale : 1.0;
  const double duration_s = session.num_orbits * input.orbit_period_s - input.config.transient_s;
  return scale * scale * differential_x_psd(input.noise, f) *
         std::norm(response(filter, f, input.sample_period_s)) / duration_s;
}

/// Variance of a target's slope, from the regressors as they were measured.
double slope_variance(SessionTarget target, const RunPhasors& records,
                      const EstimationInput& input) {
  const TargetInfo& info = target_info(target);
  double noise = 0.0, square = 0.0;
  for_each_session_of(target, input.sessions, [&](std::size_t i, double weight) {
    for (std::size_t line = 0; line < records[i].num_fit_lines; ++line) {
      const double weighted = weight * std::norm(records[i].amplitude[index(info.regressor)][line]);
      square += weighted;
      noise += weight * weighted * line_variance(input.sessions[i], line, input);
    }
  });
  return info.scale * info.scale * noise / (square * square);
}

/// What the noise of the sensors makes of the estimates, each from lines of its own. Left out is
/// what the error of one makes of another: with the loops of 2013 it is far below the noise of
/// that; with slow ones a_d11' makes more of a_c11Δ, of which tests only take a_c11Δy.
void set_standard_errors(const RunPhasors& records, const EstimationInput& input,
                         Estimation& estimation) {
  ParameterArray variances{};
  for (const auto& [target, parameter] : determined_parameters) {
    variances[index(parameter)] = slope_variance(target, records, input);
  }
  variances[index(Parameter::k2c)] =
      0.25 * (slope_variance(SessionTarget::k2_sensor_1, records, input) +
              slope_variance(SessionTarget::k2_sensor_2, records, input));
  for (std::size_t i = 0; i < num_parameters; ++i) {
    estimation.standard_errors[i] = std::sqrt(variances[i]);
    estimation.correlations[i][i] = 1.0;
  }
}

}  // namespace

Estimation estimate_hardy2013(const RunPhasors& records, const EstimationInput& input) {
  const std::vector<Session>& sessions = input.sessions;
  const EstimationConfig& config = input.config;
  const ParameterArray& objectives = input.objectives;
  PROOFMASS_EXPECT(records.size() == sessions.size());
  Estimates known;
  Estimation result;
  while (!result.converged && result.num_rounds < config.num_rounds_max) {
    const Estimates next = Round(records, sessions, config.correction, known).estimates();
    result.converged = has_settled(known, next, config.convergence, objectives);
    known = next;
    ++result.num_rounds;
  }
  result.values = known.value;
  set_standard_errors(records, input, result);
  return result;
}

RecordNeeds hardy2013_needs(const Session& session) {
  return {.signals = target_info(session.target).signals};
}

void check_hardy2013(const std::vector<Session>& sessions) {
  for (std::size_t i = 0; i < sessions.size(); ++i) {
    if (mass_excitations(sessions[i])[1] == nullptr) continue;
    throw ConfigError(fmt::format("session[{}].excitations", i), "two that move test masses",
                      "estimation.method = \"hardy2013\" takes one");
  }
  for (const std::string_view name : names_of(SessionTarget{})) {
    if (name == target_info(SessionTarget::no_target).name) continue;
    if (name == target_info(SessionTarget::ep_test).name) continue;
    const auto serves = [&](const Session& session) {
      return target_info(session.target).name == name;
    };
    if (std::ranges::any_of(sessions, serves)) continue;
    throw ConfigError("session", fmt::format("{} sessions", sessions.size()),
                      fmt::format("none has the target {}", name));
  }
}

}  // namespace proofmass
