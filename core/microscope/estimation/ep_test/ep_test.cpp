#include "core/microscope/estimation/ep_test/ep_test.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <numbers>
#include <optional>
#include <vector>

#include "core/error.hpp"
#include "core/math/elementary.hpp"
#include "core/microscope/control/star_tracker.hpp"
#include "core/signal/noise_shape.hpp"

namespace proofmass {
namespace {

using enum TestSignal;

constexpr auto num_averaged = static_cast<Eigen::Index>(num_averaged_signals);
constexpr auto num_fitted = static_cast<Eigen::Index>(num_test_regressors);
constexpr auto num_calibrated = static_cast<Eigen::Index>(num_parameters);
constexpr auto num_times = static_cast<Eigen::Index>(num_powers);
constexpr auto num_columns = static_cast<Eigen::Index>(num_test_columns) - num_times;

/// Factors of the averaged signals in a sum of them.
using Factors = Eigen::Matrix<double, num_averaged, 1>;
using Fitted = Eigen::Matrix<double, num_fitted, 1>;
using FittedMatrix = Eigen::Matrix<double, num_fitted, num_fitted>;

/// Among the averaged signals. The first are what the fitted parameters multiply by half, in the
/// order of TestParameter.
constexpr Eigen::Index place(TestSignal signal) {
  return static_cast<Eigen::Index>(index(signal)) - num_times;
}
static_assert(place(gravity_x) == 0 && place(gradient_xx) == 1 && place(gradient_xz) == 2);

/// Sums of products over the windows that a session did not lose.
struct WindowSums {
  double num_windows = 0.0;          ///< By weight.
  Factors means;                     ///< Of the averaged signals.
  double mean_square_gravity = 0.0;  ///< Of g_x² + g_z², (m/s²)².
  /// Of the columns that are no power of time with the averaged signals, both without their cubic
  /// polynomials in time.
  Eigen::Matrix<double, num_columns, num_averaged> products;
};

/// None if what was not lost determines no cubic polynomial.
std::optional<WindowSums> window_sums(const SessionPhasors& record) {
  constexpr auto size = static_cast<Eigen::Index>(num_test_signals);
  PROOFMASS_EXPECT(record.test_products.size() == num_test_products);
  Eigen::Matrix<double, size, size> all = Eigen::Matrix<double, size, size>::Zero();
  for (std::size_t k = 0; k < num_test_products; ++k) {
    const auto [i, j] = test_product_pairs[k];
    all(i, j) = all(j, i) = record.test_products[k];
  }
  const Eigen::Matrix<double, num_times, num_times> powers =
      all.topLeftCorner<num_times, num_times>();
  const Eigen::Matrix<double, num_times, num_averaged> mixed =
      all.topRightCorner<num_times, num_averaged>();
  // Of 16 digits of the products six at least are left without their polynomial; windows that lie
  // within some percent of a record leave fewer.
  constexpr double condition_min = 1e-10;
  const Eigen::LLT<Eigen::Matrix<double, num_times, num_times>> factored(powers);
  if (factored.info() != Eigen::Success || factored.rcond() < condition_min) return std::nullopt;
  const Eigen::Matrix<double, num_times, num_averaged> polynomials = factored.solve(mixed);
  WindowSums sums;
  sums.num_windows = powers(0, 0);
  sums.means = mixed.row(0).transpose() / sums.num_windows;
  const auto square = [&](TestSignal signal) {
    return all(num_times + place(signal), num_times + place(signal));
  };
  sums.mean_square_gravity = (square(gravity_x) + square(gravity_z)) / sums.num_windows;
  sums.products = all.block<num_columns, num_averaged>(num_times, num_times) -
                  mixed.leftCols<num_columns>().transpose() * polynomials;
  return sums;
}

/// Factors, s⁻⁴/Hz, of the one-sided density at f_EP that noise of the estimated attitude gives
/// ½(a_c11Δx G_xx + a_c11Δy G_xy + a_c11Δz G_xz), (m/s²)²/Hz: xx x² + xz x z + zz z² + yy y² with
/// x = ½ a_c11Δx and so on.
struct AttitudeNoise {
  double xx = 0.0, xz = 0.0, zz = 0.0, yy = 0.0;
};

/// What the estimated rate ω has of errors θ of the star tracker's angles and α of the measured
/// angular acceleration.
struct RateErrors {
  std::complex<double> of_angle;         ///< 1/s.
  std::complex<double> of_acceleration;  ///< s.
};

/// In a frame that turns about Y at the rate Ω the estimator has θ̂' = ω − Ω × θ̂ + 3 ω_h (θ − θ̂),
/// ω' = α + 3 ω_h² (θ − θ̂) + ω_h³ ∫(θ − θ̂), ω_h being its crossover. Of θ_x + i θ_z and
/// α_x + i α_z, with a = s − iΩ, L = 3 ω_h²/s + ω_h³/s² and Q = L/(a + 3 ω_h + L), this makes
///
///     ω_x + i ω_z = Q a θ + (1 − Q) α/s
///
/// About Y it is the same with Ω = 0.
RateErrors rate_errors(double crossover, double rate_rad_s, std::complex<double> s) {
  const std::complex<double> a = s - std::complex<double>(0.0, rate_rad_s);
  const std::complex<double> slow = crossover * crossover * (3.0 * s + crossover) / (s * s);
  const std::complex<double> part = slow / (a + 3.0 * crossover + slow);
  return {.of_angle = part * a, .of_acceleration = (1.0 - part) / s};
}

/// Of the turn about Y at the rate Ω, G_xx has 2 Ω ω_y, G_xy −Ω ω_x + α_z and G_xz −α_y of the
/// errors ω of the estimated rate and α of the measured angular acceleration.
AttitudeNoise attitude_noise(const EstimationInput& input, double rate_rad_s, double frequency_hz) {
  const double crossover = 2.0 * std::numbers::pi * input.attitude.blending_hz;
  const std::complex<double> s(0.0, 2.0 * std::numbers::pi * frequency_hz);
  const RateErrors about_y = rate_errors(crossover, 0.0, s);
  // The real part of a complex signal has half the sum of its law and that of its conjugate.
  const RateErrors one = rate_errors(crossover, rate_rad_s, s);
  const RateErrors other = rate_errors(crossover, -rate_rad_s, s);
  const std::complex<double> half(0.5, 0.0), turned(0.0, 0.5);
  const RateErrors x_of_x{.of_angle = half * (one.of_angle + other.of_angle),
                          .of_acceleration = half * (one.of_acceleration + other.of_acceleration)};
  const RateErrors x_of_z{
      .of_angle = turned * (one.of_angle - other.of_angle),
      .of_acceleration = turned * (one.of_acceleration - other.of_acceleration)};

  const Eigen::Matrix3d factor =
      make_star_tracker(input.noise, input.sample_period_s).noise_factor_S_rad;
  const Eigen::Matrix3d angles = 2.0 * input.sample_period_s * factor * factor.transpose();
  const double acceleration = nominal_psd(input.noise.angular, frequency_hz);
  const auto rate_about_y = std::norm(about_y.of_angle) * angles(1, 1) +
                            std::norm(about_y.of_acceleration) * acceleration;
  const double rate_about_x = std::norm(x_of_x.of_angle) * angles(0, 0) +
                              std::norm(x_of_z.of_angle) * angles(2, 2) +
                              std::norm(x_of_x.of_acceleration) * acceleration;
  return {.xx = 4.0 * rate_rad_s * rate_rad_s * rate_about_y,
          .xz = -4.0 * rate_rad_s * about_y.of_acceleration.real() * acceleration,
          .zz = acceleration,
          .yy = rate_rad_s * rate_rad_s * rate_about_x +
                std::norm(1.0 - rate_rad_s * x_of_z.of_acceleration) * acceleration};
}

/// A session that tests.
struct TestRecord {
  WindowSums sums;
  /// Γ_App,cx over Γ_App,dx of what is constant: 0 if the loop nulls both sensors, −1 or 1 if it
  /// nulls the first or the second.
  double common_part = 0.0;
  SquareSteps<double> square_steps;
  AttitudeNoise attitude_noise;
  FittedMatrix noise;   ///< XᵀRX of the regressors, of noise of scale 1.
  double weight = 0.0;  ///< 1/S(f_EP), Hz/(m/s²)².
};

/// None if the session tells nothing.
std::optional<TestRecord> test_record(const SessionPhasors& record, const Session& session,
                                      const EstimationInput& input) {
  const std::optional<WindowSums> sums = window_sums(record);
  if (!sums || record.square_steps.weight == 0.0) return std::nullopt;
  TestRecord of;
  of.sums = *sums;
  of.square_steps = record.square_steps;
  if (session.drag_free == DragFreeSource::sensor_1) of.common_part = -1.0;
  if (session.drag_free == DragFreeSource::sensor_2) of.common_part = 1.0;
  for (Eigen::Index i = 0; i < num_fitted; ++i) {
    const auto& products = record.test_noise[static_cast<std::size_t>(i)];
    of.noise.row(i) = Eigen::Map<const Fitted>(products.data()).transpose();
  }
  const double f = test_frequency_hz(session, input.orbit_period_s);
  of.attitude_noise = attitude_noise(input, session.spin_rate_rad_s, f);
  of.weight = 1.0 / differential_x_density(input.noise, [&](const SensorNoise& x) {
                return 2.0 * window_noise_psd(x, f, input.sample_period_s);
              });
  return of;
}

/// What is left of Γ_mes,dx when all that the calibration knows is taken away, as a sum of signals.
Factors corrected(const TestRecord& record, const ParameterArray& calibration) {
  const auto known = [&](Parameter parameter) { return calibration[index(parameter)]; };
  Factors factors = Factors::Zero();
  factors[place(differential_x)] = 1.0;
  const auto subtract = [&](TestSignal signal, double factor) { factors[place(signal)] -= factor; };
  subtract(common_x, known(Parameter::a_d11_prime));
  subtract(common_y, known(Parameter::a_d12));
  subtract(common_z, known(Parameter::a_d13));
  const double x = 0.5 * known(Parameter::a_c11_delta_x);
  const double y = 0.5 * known(Parameter::a_c11_delta_y);
  const double z = 0.5 * known(Parameter::a_c11_delta_z);
  subtract(gradient_xy, y);
  subtract(gradient_yx, known(Parameter::a_c12) * x);
  subtract(gradient_yy, known(Parameter::a_c12) * y);
  subtract(gradient_yz, known(Parameter::a_c12) * z);
  subtract(gradient_zx, known(Parameter::a_c13) * x);
  subtract(gradient_zy, known(Parameter::a_c13) * y);
  subtract(gradient_zz, known(Parameter::a_c13) * z);
  // Squares about the means: a_d11' holds what the means make, but for that of the gradient.
  const auto mean = [&](TestSignal signal) { return record.sums.means[place(signal)]; };
  const double of_gradient = mean(gradient_xx) * x + mean(gradient_xy) * y + mean(gradient_xz) * z;
  const double known_mean = mean(differential_x) - of_gradient;
  const double known_common_mean = mean(common_x) - record.common_part * of_gradient;
  const double k2d = known(Parameter::k2d), twice_k2c = 2.0 * known(Parameter::k2c);
  subtract(common_squared, k2d);
  subtract(common_x, -2.0 * k2d * known_common_mean);
  subtract(common_product, twice_k2c);
  subtract(common_x, -twice_k2c * known_mean);
  subtract(differential_x, -twice_k2c * known_common_mean);
  return factors;
}

/// Products of the fitted regressors.
FittedMatrix fitted_block(const TestRecord& record) {
  return record.sums.products.topLeftCorner<num_fitted, num_fitted>();
}

/// Products of the fitted regressors with a sum of signals.
Fitted fitted_with(const TestRecord& record, const Factors& sum) {
  return record.sums.products.topRows<num_fitted>() * sum;
}

/// Covariance of a window with all others, (m/s²)², by the noise of the squares that corrected()
/// subtracts: white noise of the variance s² of a sample makes s²/n of it and, of the fourth
/// difference of windows that overlap by half, the variance (s²/n) (28 − 21/n²).
double square_noise(const TestRecord& record, const ParameterArray& calibration) {
  constexpr auto n = static_cast<double>(test_block_size);
  constexpr double of_steps = 1.0 / (28.0 - 21.0 / (n * n));
  const double k2d = calibration[index(Parameter::k2d)];
  const double twice_k2c = 2.0 * calibration[index(Parameter::k2c)];
  const SquareSteps<double>& steps = record.square_steps;
  const double squared_step = k2d * k2d * steps.common + 2.0 * k2d * twice_k2c * steps.mixed +
                              twice_k2c * twice_k2c * steps.product;
  return of_steps * squared_step / steps.weight;
}

/// The same by the noise of the attitude in the gradients that corrected() subtracts, at a scale of
/// 1: noise of a density S that is alike near f_EP.
double attitude_noise(const TestRecord& record, const ParameterArray& calibration,
                      double sample_period_s) {
  const double x = 0.5 * calibration[index(Parameter::a_c11_delta_x)];
  const double y = 0.5 * calibration[index(Parameter::a_c11_delta_y)];
  const double z = 0.5 * calibration[index(Parameter::a_c11_delta_z)];
  const AttitudeNoise& noise = record.attitude_noise;
  const double density = noise.xx * x * x + noise.xz * x * z + noise.zz * z * z + noise.yy * y * y;
  return density / (2.0 * static_cast<double>(test_block_size) * sample_period_s);
}

/// Covariance of the calibration's estimates; 0 if it has no standard errors.
Eigen::Matrix<double, num_calibrated, num_calibrated> covariance_of(const Estimation& calibration) {
  Eigen::Matrix<double, num_calibrated, num_calibrated> covariance;
  for (std::size_t i = 0; i < num_parameters; ++i) {
    for (std::size_t j = 0; j < num_parameters; ++j) {
      covariance(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) =
          calibration.correlations[i][j] * calibration.standard_errors[i] *
          calibration.standard_errors[j];
    }
  }
  return covariance;
}

/// The fit of all tests of a run.
class TestFit {
 public:
  TestFit(const RunPhasors& records, const EstimationInput& input)
      : scale_(input.noise.scale > 0.0 ? input.noise.scale : 1.0),
        sample_period_s_(input.sample_period_s) {
    for (std::size_t i = 0; i < records.size(); ++i) {
      if (!is_test(input.sessions[i])) continue;
      if (auto test = test_record(records[i], input.sessions[i], input)) tests_.push_back(*test);
    }
    FittedMatrix normal = FittedMatrix::Zero();
    for (const TestRecord& test : tests_) normal += test.weight * fitted_block(test);
    inverse_ = normal.llt().solve(FittedMatrix::Identity());
  }

  [[nodiscard]] Fitted values(const ParameterArray& calibration) const {
    Fitted sum = Fitted::Zero();
    for (const TestRecord& test : tests_) {
      sum += test.weight * fitted_with(test, corrected(test, calibration));
    }
    return 2.0 * (inverse_ * sum);
  }

  /// By the noise of the sensors, and of the squares and gradients that are subtracted.
  [[nodiscard]] FittedMatrix covariance(const ParameterArray& calibration) const {
    FittedMatrix sum = FittedMatrix::Zero();
    for (const TestRecord& test : tests_) {
      const double subtracted =
          square_noise(test, calibration) +
          scale_ * scale_ * attitude_noise(test, calibration, sample_period_s_);
      sum += test.weight * test.weight *
             (scale_ * scale_ * test.noise + subtracted * fitted_block(test));
    }
    return 4.0 * inverse_ * sum * inverse_;
  }

  /// Derivatives of values() by the calibration's estimates: the fit is linear in each of them.
  [[nodiscard]] Eigen::Matrix<double, num_fitted, num_calibrated> jacobian(
      const ParameterArray& calibration, const ParameterArray& steps) const {
    Eigen::Matrix<double, num_fitted, num_calibrated> derivatives;
    const Fitted at = values(calibration);
    for (std::size_t i = 0; i < num_parameters; ++i) {
      ParameterArray moved = calibration;
      moved[i] += steps[i];
      derivatives.col(static_cast<Eigen::Index>(i)) = (values(moved) - at) / steps[i];
    }
    return derivatives;
  }

 private:
  double scale_;
  double sample_period_s_;
  std::vector<TestRecord> tests_;
  FittedMatrix inverse_;
};

}  // namespace

double test_residual_m_s2(const SessionPhasors& record) {
  const std::optional<WindowSums> sums = window_sums(record);
  if (!sums) return 0.0;
  using Gravity = Eigen::Matrix<double, 2, 1>;
  const auto with = [&](TestSignal signal) {
    return Gravity(sums->products(place(gravity_x), place(signal)),
                   sums->products(place(gravity_z), place(signal)));
  };
  Eigen::Matrix2d normal;
  normal << with(gravity_x), with(gravity_z);
  const Eigen::LDLT<Eigen::Matrix2d> factored(normal);
  double largest = 0.0;
  for (const TestSignal axis : {common_x, common_y, common_z}) {
    largest = std::max(largest, factored.solve(with(axis)).norm());
  }
  return largest * std::sqrt(sums->mean_square_gravity);
}

double window_noise_psd(const SensorNoise& sensor, double frequency_hz, double sample_period_s) {
  constexpr auto num_samples = static_cast<double>(test_block_size);
  // Two blocks' means, one after the other, and the mean of two samples: slopes in steps.
  const auto gain = [&](double f) {
    const double turns = 0.5 * f * sample_period_s;
    const double mean =
        sincos_turns(num_samples * turns).sine / (num_samples * sincos_turns(turns).sine);
    return mean * mean * sincos_turns(turns).cosine;
  };
  const double rate_hz = 1.0 / (num_samples * sample_period_s);
  double sum = 0.0;
  constexpr int num_folds = static_cast<int>(test_block_size) / 2;
  for (int k = -num_folds; k < num_folds; ++k) {
    const double f = std::abs(frequency_hz + k * rate_hz);
    sum += 0.5 * nominal_psd(sensor, f) * gain(f) * gain(f);
  }
  return sum;
}

TestEstimation estimate_ep_test(const RunPhasors& records, const EstimationInput& input,
                                const Estimation& calibration) {
  PROOFMASS_EXPECT(records.size() == input.sessions.size());
  const TestFit fit(records, input);
  const Fitted values = fit.values(calibration.values);
  const auto jacobian = fit.jacobian(calibration.values, input.objectives);
  const auto of_calibration = covariance_of(calibration);
  constexpr auto eotvos = static_cast<Eigen::Index>(index(TestParameter::eotvos_parameter));
  const Eigen::RowVectorXd with_calibration = jacobian.row(eotvos) * of_calibration;

  TestEstimation result;
  for (std::size_t i = 0; i < num_test_regressors; ++i) {
    result.values[i] = values[static_cast<Eigen::Index>(i)];
  }
  result.values[index(TestParameter::uncorrected)] = fit.values({})[eotvos];
  result.standard_error = std::sqrt(fit.covariance(calibration.values)(eotvos, eotvos) +
                                    with_calibration.dot(jacobian.row(eotvos)));
  for (std::size_t i = 0; i < num_parameters; ++i) {
    if (calibration.standard_errors[i] == 0.0) continue;
    result.correlations[i] = with_calibration[static_cast<Eigen::Index>(i)] /
                             (result.standard_error * calibration.standard_errors[i]);
  }
  return result;
}

}  // namespace proofmass
