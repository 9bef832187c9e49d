#include "core/microscope/control/control_loops.hpp"

#include <numbers>

#include "core/math/elementary.hpp"

namespace proofmass {
namespace {
constexpr double two_pi = 2.0 * std::numbers::pi;
}  // namespace

DragFreeGains drag_free_gains(const DragFreeConfig& config, double sample_period_s) {
  return {.proportional = two_pi * config.bandwidth_hz * sample_period_s,
          .integral = two_pi * config.integral_hz * sample_period_s};
}

ResonatorGains resonator_gains(double damping, double frequency_hz, double sample_period_s) {
  const SineCosine turn = sincos_turns(frequency_hz * sample_period_s);
  return {.cosine = turn.cosine,
          .sine = turn.sine,
          .input = 2.0 * damping * two_pi * frequency_hz * sample_period_s};
}

AttitudeGains attitude_gains(const AttitudeConfig& config, double sample_period_s) {
  const double period = sample_period_s;
  const double r = exponential(-two_pi * config.blending_hz * period);
  const double gap = 1.0 - r;
  const double omega = two_pi * config.bandwidth_hz;
  return {.sample_period_s = period,
          .blend_angle = 1.0 - r * r * r,
          .blend_rate_per_s = 1.5 * gap * gap * (1.0 + r) / period,
          .blend_bias_per_s2 = gap * gap * gap / (period * period),
          .stiffness_per_s2 = omega * omega,
          .damping_per_s = 2.0 * config.damping * omega,
          .integral_per_s3 = omega * omega * two_pi * config.integral_hz};
}

}  // namespace proofmass
