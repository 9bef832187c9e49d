#include "core/microscope/control/control_loops.hpp"
#include "core/microscope/control/star_tracker.hpp"
#include "tests/support/constants.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

TEST(Resonator, PassesEverythingWithoutDamping) {
  const ResonatorGains gains = resonator_gains(0.0, 0.02, period_s);
  Resonator<double> resonator;
  for (int k = 0; k < 100; ++k) {
    const Vector3<double> input{1e-8 * k, -3e-9 * k * k, 1e-10};
    const Vector3<double> passed = resonator.advance(gains, input);
    EXPECT_EQ(passed.x, input.x);
    EXPECT_EQ(passed.y, input.y);
    EXPECT_EQ(passed.z, input.z);
  }
}

// Closed over the sample that passes until a command acts, the loop with a resonator forgets a push
// whatever its corners: within 60 times 1/(ζω_0).
TEST(DragFreeLoop, IsStableWithAResonatorUpToHalfOfItsBandwidth) {
  for (const double bandwidth_hz : {0.01, 0.05, 0.2}) {
    for (const double integral : {0.1, 0.25, 0.9}) {
      for (const double resonance : {0.02, 0.1, 0.5}) {
        for (const double damping : {0.1, 0.5, 0.9}) {
          const DragFreeConfig config{.bandwidth_hz = bandwidth_hz,
                                      .integral_hz = std::min(0.05, integral * bandwidth_hz)};
          const double resonance_hz = resonance * bandwidth_hz;
          const DragFreeGains gains = drag_free_gains(config, period_s);
          const ResonatorGains shaping = resonator_gains(damping, resonance_hz, period_s);
          DragFreeController<double> controller;
          Resonator<double> resonator;
          const double omega_s = 2.0 * std::numbers::pi * resonance_hz;
          const int num_samples = static_cast<int>(60.0 / (damping * omega_s * period_s));
          double command = 0.0;
          for (int k = 0; k < num_samples; ++k) {
            const double measured = (k == 0 ? 1.0 : 0.0) - command;
            command = controller.advance(gains, resonator.advance(shaping, {measured, 0, 0})).x;
          }
          EXPECT_LT(std::abs(command), 1e-6)
              << bandwidth_hz << ' ' << integral << ' ' << resonance << ' ' << damping;
        }
      }
    }
  }
}

/// Angle about X and acceleration that leads from each sample to the next under constant
/// acceleration.
struct Trajectory {
  std::vector<double> angle;
  std::vector<double> acceleration;
};

Trajectory swinging_trajectory(int num_samples) {
  Trajectory trajectory;
  double angle = 0.0;
  double rate = 0.0;
  for (int k = 0; k < num_samples; ++k) {
    const double acceleration = 1e-6 * std::sin(0.05 * k) + 3e-7 * std::cos(0.7 * k);
    trajectory.angle.push_back(angle);
    trajectory.acceleration.push_back(acceleration);
    angle += period_s * rate + 0.5 * period_s * period_s * acceleration;
    rate += period_s * acceleration;
  }
  return trajectory;
}

/// Estimates of the angle from star tracker and accelerometer, either switched off by a zero
/// factor.
std::vector<double> blended(const Trajectory& trajectory, double star_factor,
                            double acceleration_factor) {
  const AttitudeGains gains = attitude_gains({}, period_s);
  AttitudeEstimator<double> estimator;
  std::vector<double> estimates;
  for (std::size_t k = 0; k < trajectory.angle.size(); ++k) {
    estimator.correct(gains, {star_factor * trajectory.angle[k], 0.0, 0.0});
    estimates.push_back(estimator.angle_RS_S.x);
    estimator.predict(gains, {acceleration_factor * trajectory.acceleration[k], 0.0, 0.0}, zero);
  }
  return estimates;
}

// LP + HP = 1: fed with a true angle and the acceleration that goes with it, the two branches sum
// to that angle, to rounding.
TEST(AttitudeEstimator, ItsTwoFiltersSumToOne) {
  const Trajectory trajectory = swinging_trajectory(20000);
  const std::vector<double> low = blended(trajectory, 1.0, 0.0);
  const std::vector<double> high = blended(trajectory, 0.0, 1.0);
  double largest = 0.0;
  double branch = 0.0;
  for (std::size_t k = 0; k < low.size(); ++k) {
    largest = std::max(largest, std::abs(trajectory.angle[k]));
    branch = std::max(branch, std::abs(low[k]));
    ASSERT_NEAR(low[k] + high[k], trajectory.angle[k], 1e-11 * std::max(largest, 1e-6)) << k;
  }
  EXPECT_GT(branch, 0.1 * largest);  // Neither branch is trivial.
}

// Both filters share the triple pole r, so without input every output obeys
// y₃ − 3r y₂ + 3r² y₁ − r³ y₀ = 0.
TEST(AttitudeEstimator, ForgetsWithATriplePole) {
  const AttitudeConfig config;
  const AttitudeGains gains = attitude_gains(config, period_s);
  const double r = std::exp(-2.0 * std::numbers::pi * config.blending_hz * period_s);
  AttitudeEstimator<double> estimator{
      .angle_RS_S = {1.0, 0.0, 0.0}, .omega_RS_S = {0.1, 0.0, 0.0}, .bias_S = {-0.02, 0.0, 0.0}};
  std::vector<double> y;
  for (int k = 0; k < 200; ++k) {
    estimator.correct(gains, zero);
    y.push_back(estimator.angle_RS_S.x);
    estimator.predict(gains, zero, zero);
  }
  for (std::size_t k = 0; k + 3 < y.size(); ++k) {
    ASSERT_NEAR(y[k + 3] - 3 * r * y[k + 2] + 3 * r * r * y[k + 1] - r * r * r * y[k], 0.0, 1e-13);
  }
}

// The high-pass removes the accelerometer's bias, which the third state takes up.
TEST(AttitudeEstimator, RemovesAConstantBiasOfTheAccelerometer) {
  const AttitudeGains gains = attitude_gains({}, period_s);
  const double bias = 1e-9;
  AttitudeEstimator<double> estimator;
  for (int k = 0; k < 40000; ++k) {  // 10,000 s are 188 time constants.
    estimator.correct(gains, zero);
    estimator.predict(gains, {bias, -bias, 0.0}, zero);
  }
  EXPECT_NEAR(estimator.angle_RS_S.x, 0.0, 1e-9 * bias / (gains.blend_bias_per_s2));
  EXPECT_NEAR(estimator.bias_S.x, bias, 1e-9 * bias);
  EXPECT_NEAR(estimator.bias_S.y, -bias, 1e-9 * bias);
}

// In a rotating reference a constant inertial pointing error turns in the frame; the estimator's
// prediction follows it: an angle along X with Ω about Y turns into Z at −Ω∧θ.
TEST(AttitudeEstimator, PredictsInARotatingReference) {
  const AttitudeGains gains = attitude_gains({}, period_s);
  AttitudeEstimator<double> estimator{
      .angle_RS_S = {1e-4, 0.0, 0.0}, .omega_RS_S = zero, .bias_S = zero};
  const double spin = 0.01;
  estimator.predict(gains, zero, {0.0, spin, 0.0});
  EXPECT_DOUBLE_EQ(estimator.angle_RS_S.x, 1e-4);
  EXPECT_DOUBLE_EQ(estimator.angle_RS_S.z, 1e-4 * spin * period_s);  // −(Ω ŷ ∧ θ x̂) = +Ωθ ẑ
}

// At rest in angle and rate only the proportional part acts at first; the integral adds ω²ω_I∫θ dt.
TEST(AttitudeController, IsProportionalDerivativeWithASlowIntegral) {
  const AttitudeConfig config;
  const AttitudeGains gains = attitude_gains(config, period_s);
  const double omega = 2.0 * std::numbers::pi * config.bandwidth_hz;
  AttitudeController<double> controller;
  const AttitudeEstimator<double> estimate{
      .angle_RS_S = {1e-5, 0.0, 0.0}, .omega_RS_S = {0.0, 2e-7, 0.0}, .bias_S = zero};
  Vector3<double> command{};
  const int num_samples = 40;
  for (int k = 0; k < num_samples; ++k) command = controller.advance(gains, estimate);
  const double integral =
      2.0 * std::numbers::pi * config.integral_hz * num_samples * period_s * 1e-5;
  EXPECT_NEAR(command.x, -omega * omega * (1e-5 + integral), 1e-14 * 1e-5);
  EXPECT_NEAR(command.y, -2.0 * config.damping * omega * 2e-7, 1e-14 * 2e-7);
}

// The boresights are orthogonal, so along X, and along each boresight, the two heads' information
// adds: 2/σ², and 1/σ_b² + 1/σ² twice. The last two are equal, so the fused noise is isotropic in Y
// and Z.
TEST(StarTracker, FusesTwoHeadsByInverseCovariance) {
  NoiseConfig noise;
  noise.star_tracker_across_asd_rad = 7e-6;
  noise.star_tracker_boresight_asd_rad = 3.5e-5;
  const double samples_per_s = 4.0;
  const StarTracker tracker = make_star_tracker(noise, 1.0 / samples_per_s);
  const double across = 7e-6 * 7e-6 * samples_per_s / 2.0;  // One-sided density to sample variance.
  const double about = 25.0 * across;
  Eigen::Matrix3d expected = Eigen::Matrix3d::Zero();
  expected(0, 0) = across / 2.0;
  expected(1, 1) = expected(2, 2) = 1.0 / (1.0 / across + 1.0 / about);
  const Eigen::Matrix3d covariance =
      tracker.noise_factor_S_rad * tracker.noise_factor_S_rad.transpose();
  EXPECT_LT((covariance - expected).norm(), 1e-14 * across);
  EXPECT_LT((tracker.weight[0] + tracker.weight[1] - Eigen::Matrix3d::Identity()).norm(), 1e-14);
}

TEST(StarTracker, WeighsEachHeadsBiasWhereItSeesBest) {
  const StarTracker tracker = make_star_tracker({}, 0.25);
  // A bias of head 1 about its own boresight hardly counts: σ²/(σ² + σ_b²) = 1/26.
  const Eigen::Vector3d boresight = Eigen::Vector3d(0.0, 1.0, 1.0).normalized();
  const Eigen::Vector3d fused = tracker.fused_bias_S({1e-5 * boresight, Eigen::Vector3d::Zero()});
  EXPECT_LT((fused - 1e-5 / 26.0 * boresight).norm(), 1e-18);
  // About X both count alike.
  const Eigen::Vector3d x =
      tracker.fused_bias_S({Eigen::Vector3d(2e-5, 0, 0), Eigen::Vector3d::Zero()});
  EXPECT_NEAR(x.x(), 1e-5, 1e-19);
}

}  // namespace
}  // namespace proofmass
