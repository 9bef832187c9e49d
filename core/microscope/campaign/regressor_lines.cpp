#include "core/microscope/campaign/regressor_lines.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <numbers>

#include "core/error.hpp"
#include "core/math/elementary.hpp"
#include "core/microscope/estimation/methods.hpp"
#include "core/microscope/orbit/kepler_orbit.hpp"
#include "core/signal/noise_shape.hpp"

namespace proofmass {
namespace {

using Complex = std::complex<double>;
constexpr double full_turn = 2.0 * std::numbers::pi;
constexpr Complex i_unit{0.0, 1.0};

SpectralLines operator*(const SpectralLines& a, const SpectralLines& b) {
  SpectralLines product;
  product.reserve(a.size() * b.size());
  for (const SpectralLine& x : a) {
    for (const SpectralLine& y : b) {
      product.push_back({x.frequency_hz + y.frequency_hz, x.amplitude * y.amplitude});
    }
  }
  return product;
}

SpectralLines operator*(const Complex& factor, SpectralLines lines) {
  for (SpectralLine& line : lines) line.amplitude *= factor;
  return lines;
}

SpectralLines operator+(SpectralLines a, const SpectralLines& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

/// Each line times a function of its frequency.
template <typename Factor>
SpectralLines filtered(SpectralLines lines, const Factor& factor) {
  for (SpectralLine& line : lines) line.amplitude *= factor(line.frequency_hz);
  return lines;
}

/// Elements of [T] in the frame that the attitude loop holds, which follow from μ/r³ and
/// φ = ν + Ω t: T_yy = −μ/r³, T_xx = ½ μ/r³ (1 + 3 cos 2φ), T_zz with −3, T_xz = 3/2 μ/r³ sin 2φ.
struct GradientLines {
  SpectralLines monopole;  ///< μ/r³, s⁻².
  SpectralLines cosine;    ///< μ/r³ cos 2φ, s⁻².
  SpectralLines sine;      ///< μ/r³ sin 2φ, s⁻².
};

GradientLines gradient_lines(const OrbitConfig& config, double spin_hz) {
  // Harmonics fall with 0.64^k at the largest e, ½, and faster below: these are not aliased.
  constexpr int num_samples = 64;
  constexpr int num_harmonics = 12;
  std::array<Complex, num_samples> turn, monopole, quadrupole;
  const KeplerOrbit orbit(config);
  for (std::size_t i = 0; i < num_samples; ++i) {
    const double phase = static_cast<double>(i) / num_samples;
    const OrbitPoint point = orbit.at(phase * config.period_s);
    const Complex radial(point.radial_I_x, point.radial_I_z);
    const SineCosine of_turn = sincos_turns(phase);
    turn[i] = {of_turn.cosine, -of_turn.sine};
    monopole[i] = point.gradient_s2;
    quadrupole[i] = point.gradient_s2 * radial * radial;
  }
  GradientLines lines;
  for (int k = -num_harmonics; k <= num_harmonics; ++k) {
    Complex of_monopole, of_quadrupole;
    for (std::size_t i = 0; i < num_samples; ++i) {
      const auto place = static_cast<std::size_t>(
          ((static_cast<int>(i) * k) % num_samples + num_samples) % num_samples);
      of_monopole += monopole[i] * turn[place] / static_cast<double>(num_samples);
      of_quadrupole += quadrupole[i] * turn[place] / static_cast<double>(num_samples);
    }
    const double harmonic_hz = k / config.period_s;
    lines.monopole.push_back({harmonic_hz, of_monopole});
    const double turned_hz = harmonic_hz + 2.0 * spin_hz;
    lines.cosine.push_back({turned_hz, 0.5 * of_quadrupole});
    lines.cosine.push_back({-turned_hz, 0.5 * std::conj(of_quadrupole)});
    lines.sine.push_back({turned_hz, -0.5 * i_unit * of_quadrupole});
    lines.sine.push_back({-turned_hz, 0.5 * i_unit * std::conj(of_quadrupole)});
  }
  return lines;
}

/// The session's excitations of a kind along an axis, each a·sin(2π f t).
SpectralLines excitation_lines(const Session& session, ExcitationKind kind, Axis axis) {
  SpectralLines lines;
  for (const Excitation& excitation : session.excitations) {
    if (excitation.kind != kind || excitation.axis != axis) continue;
    lines.push_back({excitation.frequency_hz, -0.5 * i_unit * excitation.amplitude});
    lines.push_back({-excitation.frequency_hz, 0.5 * i_unit * excitation.amplitude});
  }
  return lines;
}

/// Γ_mes,c along an axis: the loop follows −C_cal.
SpectralLines common_lines(const Scenario& scenario, const Session& session, Axis axis) {
  return filtered(excitation_lines(session, ExcitationKind::drag_free, axis),
                  [&](double f) { return drag_free_sensitivity(scenario.drag_free, f) - 1.0; });
}

/// Γ_mes,k along X of the mass that moves: the loop holds the other one.
SpectralLines moved_lines(const Session& session) {
  return filtered(excitation_lines(session, ExcitationKind::test_mass, Axis::x),
                  [](double f) { return -full_turn * full_turn * f * f; });
}

/// True angle about Z that the loop makes of a commanded one: −C LP/(s² + C), with C the controller
/// and LP the star tracker's part of the estimate (core/microscope/control).
SpectralLines angle_lines(const Scenario& scenario, const Session& session) {
  const AttitudeConfig& config = scenario.attitude;
  return filtered(excitation_lines(session, ExcitationKind::attitude, Axis::z), [&](double f) {
    const Complex s = i_unit * full_turn * f;
    const double omega = full_turn * config.bandwidth_hz;
    const double blending = full_turn * config.blending_hz;
    const Complex controller = omega * omega + 2.0 * config.damping * omega * s +
                               omega * omega * full_turn * config.integral_hz / s;
    const Complex low_pass =
        (3.0 * blending * s * s + 3.0 * blending * blending * s + blending * blending * blending) /
        ((s + blending) * (s + blending) * (s + blending));
    return -controller * low_pass / (s * s + controller);
  });
}

/// [T − In]_xy of a frame that swings by α about Z: α̈ + α (T_yy − T_xx − Ω²).
SpectralLines swing_lines(const Scenario& scenario, const Session& session,
                          const GradientLines& gradient) {
  const SpectralLines angle = angle_lines(scenario, session);
  const double spin = session.spin_rate_rad_s;
  return filtered(angle, [&](double f) { return -full_turn * full_turn * f * f - spin * spin; }) +
         angle * (-1.5 * gradient.monopole + -1.5 * gradient.cosine);
}

/// ½ position of the masses times ([T − In]_jj − [T − In]_xx).
SpectralLines modulated_lines(const Session& session, Axis axis, const SpectralLines& difference) {
  return (0.5 * excitation_lines(session, ExcitationKind::test_mass, axis)) * difference;
}

/// What construction bounds each target by, [Hardy2013] tab:Budget; units of the target.
constexpr std::array<double, index(SessionTarget::no_target)> construction_bounds{
    20e-6, 20e-6, 20e-6, 2.6e-3, 2.6e-3, 1e-2, 1.6e-3, 1.6e-3, 14000.0, 14000.0, 14000.0};

/// The positive frequency at which a signal is largest, Hz. That of the motion of masses does not
/// count for the parameters which it modulates: other signals are there.
double strongest_hz(const Session& session, double resolution_hz, const SpectralLines& regressor) {
  const Excitation* const motion = mass_excitation(session);
  const bool is_modulated =
      session.target == SessionTarget::a_c12 || session.target == SessionTarget::a_c13;
  double strongest = 0.0;
  double largest = 0.0;
  for (const SpectralLine& line : regressor) {
    if (line.frequency_hz < resolution_hz || std::abs(line.amplitude) <= largest) continue;
    if (is_modulated && motion != nullptr &&
        std::abs(line.frequency_hz - motion->frequency_hz) < resolution_hz) {
      continue;
    }
    largest = std::abs(line.amplitude);
    strongest = line.frequency_hz;
  }
  return strongest;
}

}  // namespace

SpectralLines regressor_lines(const Scenario& scenario, const Session& session) {
  const double spin = session.spin_rate_rad_s;
  const auto gradient_of = [&] { return gradient_lines(scenario.orbit, spin / full_turn); };
  switch (session.target) {
    case SessionTarget::a_c11_delta_x: {
      const GradientLines gradient = gradient_of();
      return 0.5 * gradient.monopole + 1.5 * gradient.cosine;
    }
    case SessionTarget::a_c11_delta_z:
      return 1.5 * gradient_of().sine;
    case SessionTarget::a_c11_delta_y:
      return swing_lines(scenario, session, gradient_of());
    case SessionTarget::a_c12: {
      const GradientLines gradient = gradient_of();
      return modulated_lines(
          session, Axis::y,
          -1.5 * gradient.monopole + -1.5 * gradient.cosine + SpectralLines{{0.0, -spin * spin}});
    }
    case SessionTarget::a_c13:
      return modulated_lines(session, Axis::z, -3.0 * gradient_of().cosine);
    case SessionTarget::a_d11_prime:
      return common_lines(scenario, session, Axis::x);
    case SessionTarget::a_d12:
      return common_lines(scenario, session, Axis::y);
    case SessionTarget::a_d13:
      return common_lines(scenario, session, Axis::z);
    case SessionTarget::k2d: {
      const SpectralLines common = common_lines(scenario, session, Axis::x);
      return common * common;
    }
    case SessionTarget::k2_sensor_1:
    case SessionTarget::k2_sensor_2: {
      const SpectralLines moved = moved_lines(session);
      return moved * moved;
    }
    case SessionTarget::no_target:
    case SessionTarget::ep_test:
      break;
  }
  return {};
}

std::vector<double> fitted_amplitudes(const Scenario& scenario, const Session& session,
                                      const SpectralLines& regressor) {
  const double half_resolution_hz = 0.5 / (session.num_orbits * scenario.orbit.period_s);
  std::vector<double> amplitudes;
  for (const LineMultiple& line : session.fit_lines) {
    const double frequency_hz = line_frequency_hz(session, line, scenario.orbit.period_s);
    Complex sum;
    for (const SpectralLine& part : regressor) {
      if (std::abs(part.frequency_hz - frequency_hz) < half_resolution_hz) sum += part.amplitude;
    }
    amplitudes.push_back(2.0 * std::abs(sum));
  }
  return amplitudes;
}

double band_decay_s(const Scenario& scenario, const Session& session) {
  const double edge_hz =
      band_centre_hz(session, scenario.orbit.period_s) / scenario.estimation.band_ratio;
  return std::numbers::sqrt2 / (full_turn * edge_hz);
}

double band_gain_squared(const Scenario& scenario, const Session& session, double frequency_hz) {
  const double centre_hz = band_centre_hz(session, scenario.orbit.period_s);
  const double ratio = scenario.estimation.band_ratio;
  const double low = centre_hz / ratio / frequency_hz;
  const double high = frequency_hz / (ratio * centre_hz);
  return 1.0 / ((1.0 + low * low * low * low) * (1.0 + high * high * high * high));
}

Complex drag_free_sensitivity(const DragFreeConfig& config, double frequency_hz) {
  const Complex s = i_unit * full_turn * frequency_hz;
  const Complex loop =
      full_turn * config.bandwidth_hz / s * (1.0 + full_turn * config.integral_hz / s);
  return 1.0 / (1.0 + loop);
}

double fit_duration_s(const Scenario& scenario, const Session& session) {
  return session.num_orbits * scenario.orbit.period_s - scenario.estimation.transient_s;
}

namespace {

/// Standard error that noise gives a session's target where the regressor's line has this
/// amplitude, in units of the target. Noise is that of the design, or less: a noisy sensor has its
/// signals.
double line_sigma(const Scenario& scenario, const Session& session, double frequency_hz,
                  double amplitude) {
  const double density = std::min(differential_x_psd(scenario.noise, frequency_hz),
                                  differential_x_psd(NoiseConfig{}, frequency_hz));
  return std::abs(target_info(session.target).scale) *
         std::sqrt(density / fit_duration_s(scenario, session)) / amplitude;
}

}  // namespace

void check_regressors(const Scenario& scenario) {
  for (std::size_t i = 0; i < scenario.sessions.size(); ++i) {
    const Session& session = scenario.sessions[i];
    if (session.target == SessionTarget::no_target || is_test(session)) continue;
    const SpectralLines regressor = regressor_lines(scenario, session);
    const std::vector<double> amplitudes = fitted_amplitudes(scenario, session, regressor);
    for (std::size_t k = 0; k < amplitudes.size(); ++k) {
      const LineMultiple& line = session.fit_lines[k];
      const double frequency_hz = line_frequency_hz(session, line, scenario.orbit.period_s);
      const double sigma = line_sigma(scenario, session, frequency_hz, amplitudes[k]);
      const double bound = construction_bounds[index(session.target)];
      // What noise makes of the line has to be less than what is known without any session.
      if (sigma <= 3.0 * bound) continue;
      const double resolution_hz = 1.0 / (session.num_orbits * scenario.orbit.period_s);
      const double strongest_line_hz = strongest_hz(session, resolution_hz, regressor);
      const bool is_there = std::abs(strongest_line_hz - frequency_hz) < resolution_hz;
      const std::string advice =
          is_there ? "make the session longer, or its excitation larger"
                   : fmt::format("the signal's strongest line is at {:.4g} Hz", strongest_line_hz);
      throw ConfigError(
          fmt::format("session[{}].fit_lines[{}]", i, k), text_of(line),
          fmt::format("session {} has {} signal of {} there, at {:.4g} Hz: noise would make an "
                      "error of {:.2g}, and construction bounds it by {:g}; {}{}",
                      session.name, is_there ? "too little" : "no", name_of(session.target),
                      frequency_hz, sigma, bound, advice,
                      session.spin_rate_rad_s != 0.0 && line.spin == 0.0
                          ? "; lines of the gravity gradient turn with the spin, as [2, 0, 2] does"
                          : ""));
    }
  }
}

}  // namespace proofmass
