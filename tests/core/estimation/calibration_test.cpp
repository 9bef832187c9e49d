#include "core/estimation/calibration.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <limits>

#include "core/random/stream.hpp"

namespace proofmass {
namespace {

using Complex = std::complex<double>;

/// Ten values of natural size, and the objectives of the paper.
ParameterArray example_truth() {
  return {12e-6, -7e-6, 15e-6, 1.1e-3, -2.3e-3, 6e-3, -1.2e-3, 0.8e-3, 5000.0, -9000.0};
}

double at(const ParameterArray& values, Parameter parameter) { return values[index(parameter)]; }

/// Arbitrary phasors of natural size for every signal except the differential measurement.
SessionPhasors random_phasors(std::uint32_t session, std::size_t num_lines) {
  SessionPhasors phasors;
  phasors.num_lines = num_lines;
  for (std::size_t s = 1; s < num_signals; ++s) {
    for (std::size_t line = 0; line < num_lines; ++line) {
      const auto number = [&](std::uint32_t part) {
        return 2.0 * uniform(philox({session, static_cast<std::uint32_t>(s),
                                     static_cast<std::uint32_t>(line), part},
                                    1)) -
               1.0;
      };
      const double size = s <= 3 ? 1e-10 : (s == index(Signal::regressor) ? 1e-16 : 1e-8);
      phasors.amplitude[s][line] = size * Complex(number(0), number(1));
    }
  }
  return phasors;
}

/// Γ_mes,dx at first order in the instrument's errors: a_d Γ_mes,c + ½[T − In]_xj a_c11Δ_j.
Complex linear_model(const SessionPhasors& phasors, std::size_t line, const ParameterArray& truth) {
  const auto signal = [&](Signal s) { return phasors.amplitude[index(s)][line]; };
  return at(truth, Parameter::a_d11_prime) * signal(Signal::common_x) +
         at(truth, Parameter::a_d12) * signal(Signal::common_y) +
         at(truth, Parameter::a_d13) * signal(Signal::common_z) +
         0.5 * (at(truth, Parameter::a_c11_delta_x) * signal(Signal::gradient_xx) +
                at(truth, Parameter::a_c11_delta_y) * signal(Signal::gradient_xy) +
                at(truth, Parameter::a_c11_delta_z) * signal(Signal::gradient_xz));
}

/// ½ (a_c12 [T − In]_yj + a_c13 [T − In]_zj) Δ_j.
Complex product_model(const SessionPhasors& phasors, std::size_t line,
                      const ParameterArray& truth) {
  const auto signal = [&](Signal s) { return phasors.amplitude[index(s)][line]; };
  const double x = at(truth, Parameter::a_c11_delta_x);
  const double y = at(truth, Parameter::a_c11_delta_y);
  const double z = at(truth, Parameter::a_c11_delta_z);
  return 0.5 * at(truth, Parameter::a_c12) *
             (x * signal(Signal::gradient_yx) + y * signal(Signal::gradient_yy) +
              z * signal(Signal::gradient_yz)) +
         0.5 * at(truth, Parameter::a_c13) *
             (x * signal(Signal::gradient_zx) + y * signal(Signal::gradient_zy) +
              z * signal(Signal::gradient_zz));
}

/// What a record holds if Γ_mes,dx obeys the model with `truth`; `slopes` as the K2 sessions show
/// them.
struct ModelRecord {
  ParameterArray truth = example_truth();
  bool with_products = false;
  double k2d_slope = 0.0;
  std::array<double, 2> k2_slopes{};

  [[nodiscard]] CalibrationRecord make() const {
    CalibrationRecord record;
    for (std::size_t i = 0; i < num_session_targets; ++i) {
      const auto target = static_cast<SessionTarget>(i + 1);
      const bool sidebands = target == SessionTarget::a_c12 || target == SessionTarget::a_c13;
      SessionPhasors phasors = random_phasors(static_cast<std::uint32_t>(i), sidebands ? 2 : 1);
      dominate(target, phasors);
      for (std::size_t line = 0; line < phasors.num_lines; ++line) {
        Complex& differential = phasors.amplitude[index(Signal::differential_x)][line];
        const Complex regressor = phasors.amplitude[index(Signal::regressor)][line];
        differential = linear_model(phasors, line, truth);
        if (with_products && i < 3) differential += product_model(phasors, line, truth);
        if (target == SessionTarget::a_c12) differential += at(truth, Parameter::a_c12) * regressor;
        if (target == SessionTarget::a_c13) differential += at(truth, Parameter::a_c13) * regressor;
        if (target == SessionTarget::k2d) differential += k2d_slope * regressor;
        if (target == SessionTarget::k2_sensor_1) differential += 0.5 * k2_slopes[0] * regressor;
        if (target == SessionTarget::k2_sensor_2) differential -= 0.5 * k2_slopes[1] * regressor;
      }
      record[i] = phasors;
    }
    return record;
  }

  /// Each session makes its own signal a hundred times larger: that is what it is for.
  static void dominate(SessionTarget target, SessionPhasors& phasors) {
    constexpr std::array<Signal, num_session_targets> own{
        Signal::gradient_xx, Signal::gradient_xz, Signal::gradient_xy, Signal::regressor,
        Signal::regressor,   Signal::common_x,    Signal::common_y,    Signal::common_z,
        Signal::regressor,   Signal::regressor,   Signal::regressor};
    for (Complex& amplitude : phasors.amplitude[index(own[index(target)])]) amplitude *= 100.0;
    if (own[index(target)] != Signal::regressor) return;
    // The gradients of these sessions lie elsewhere in frequency.
    for (std::size_t s = 1; s < num_signals; ++s) {
      if (s == index(Signal::regressor)) continue;
      for (Complex& amplitude : phasors.amplitude[s]) amplitude *= 1e-3;
    }
  }
};

EstimationConfig precise(Correction correction) {
  EstimationConfig config;
  config.correction = correction;
  config.convergence = 1e-12;
  config.num_rounds_max = 200;
  return config;
}

const ParameterArray& objectives() {
  static const ParameterArray values = Scenario().objectives;
  return values;
}

void expect_estimates(const CalibrationResult& result, const ParameterArray& truth) {
  EXPECT_TRUE(result.converged);
  for (const ParameterInfo& info : parameter_infos()) {
    EXPECT_NEAR(result.estimate[index(info.parameter)], truth[index(info.parameter)],
                1e-9 * objectives()[index(info.parameter)])
        << info.name;
  }
}

// The iteration's fixed point is the truth where the measurement obeys the first-order model.
TEST(CalibrateHardy2013, FirstOrderInvertsTheFirstOrderModel) {
  ModelRecord model;
  model.k2d_slope = at(model.truth, Parameter::k2d);
  const double k2c = at(model.truth, Parameter::k2c);
  model.k2_slopes = {k2c + 700.0, k2c - 700.0};
  expect_estimates(
      calibrate_hardy2013(model.make(), precise(Correction::first_order), objectives()),
      model.truth);
}

// Second order: products of misalignment and off-centring in the three Δ sessions; the K2d slope is
// (K2d − a K2c)/K1c²; the slopes of the two sensors are (1 ∓ a)/(1 ± a)² of K2k/K1c².
TEST(CalibrateHardy2013, SecondOrderInvertsTheModelWithProducts) {
  ModelRecord model;
  model.with_products = true;
  const double a = at(model.truth, Parameter::a_d11_prime);
  const double k2d = at(model.truth, Parameter::k2d);
  const double k2c = at(model.truth, Parameter::k2c);
  model.k2d_slope = k2d - a * k2c;
  const double k21 = k2c + k2d;
  const double k22 = k2c - k2d;
  model.k2_slopes = {k21 * (1.0 - a) / ((1.0 + a) * (1.0 + a)),
                     k22 * (1.0 + a) / ((1.0 - a) * (1.0 - a))};
  const CalibrationRecord record = model.make();
  expect_estimates(calibrate_hardy2013(record, precise(Correction::second_order), objectives()),
                   model.truth);
  // First order leaves those terms: a K2c/K1c² is 54 s²/m here.
  const CalibrationResult first =
      calibrate_hardy2013(record, precise(Correction::first_order), objectives());
  EXPECT_NEAR(first.estimate[index(Parameter::k2d)] - k2d, -a * k2c, 1e-6);
}

// Only the part of the signal in phase with the regressor counts.
TEST(CalibrateHardy2013, IgnoresWhatIsInQuadratureWithTheRegressor) {
  ModelRecord model;
  CalibrationRecord record = model.make();
  SessionPhasors& session = record[index(SessionTarget::a_d12)];
  session.amplitude[index(Signal::differential_x)][0] +=
      Complex(0.0, 0.3) * session.amplitude[index(Signal::common_y)][0];
  const CalibrationResult result =
      calibrate_hardy2013(record, precise(Correction::first_order), objectives());
  EXPECT_NEAR(result.estimate[index(Parameter::a_d12)], at(model.truth, Parameter::a_d12), 1e-12);
}

TEST(CalibrateHardy2013, CountsItsRoundsAndSaysWhenTheyDoNotSuffice) {
  const CalibrationRecord record = ModelRecord{}.make();
  EstimationConfig config;
  config.num_rounds_max = 1;
  const CalibrationResult one = calibrate_hardy2013(record, config, objectives());
  EXPECT_FALSE(one.converged);
  EXPECT_EQ(one.num_rounds, 1U);
  config.num_rounds_max = 50;
  const CalibrationResult many = calibrate_hardy2013(record, config, objectives());
  EXPECT_TRUE(many.converged);
  EXPECT_GT(many.num_rounds, 1U);
  EXPECT_LT(many.num_rounds, 50U);
}

TEST(CalibrateHardy2013, NeverConvergesOnNumbersThatAreNotFinite) {
  CalibrationRecord record = ModelRecord{}.make();
  record[0].amplitude[0][0] = std::numeric_limits<double>::quiet_NaN();
  const CalibrationResult result = calibrate_hardy2013(record, EstimationConfig{}, objectives());
  EXPECT_FALSE(result.converged);
  EXPECT_FALSE(std::isfinite(result.estimate[0]));
}

}  // namespace
}  // namespace proofmass
