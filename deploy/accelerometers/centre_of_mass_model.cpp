// The centre-of-mass calibration of a satellite with one accelerometer, as GRACE-FO and Taiji do
// it. Torques about one axis at a time, periodic, reveal how far the accelerometer is from the
// centre of mass:
//
//     y = S [G d + a_ng] + b + n,    G = −V + Ω² + Ω̇ of kinematics.hpp.
//
// Each session is one torque. In each reading of a session a constant and a drift stand for the
// bias and for a_ng, which changes slowly; what remains is fitted with d by least squares. Torques
// tell S d but hardly S alone, so the fit takes S for 1 and counts its deviation in the standard
// errors.

#include <array>
#include <cmath>
#include <numbers>

#include "core/definition/definition_text.hpp"
#include "core/math/elementary.hpp"
#include "core/random/normal_deviates.hpp"
#include "core/random/stream.hpp"
#include "core/settings_model.hpp"
#include "kinematics.hpp"
#include "normal_equations.hpp"

namespace proofmass {
namespace {

struct CentreOfMass;

/// Simulates the sessions and fits them.
class Manoeuvres {
 public:
  explicit Manoeuvres(const CentreOfMass& settings);

  Recording recording;

  [[nodiscard]] int num_steps() const { return 3; }
  [[nodiscard]] RunResult operator()(std::uint64_t seed, RunIndex run, const RunDraw& draw,
                                     const SampleSink& sink) const;

 private:
  struct Readings {
    std::array<std::vector<double>, 3> axes;  ///< m/s², of x, y and z, by sample.
    double peak = 0.0;                        ///< The largest magnitude.
  };

  [[nodiscard]] Rotation rotation(std::size_t session, std::size_t sample) const;
  [[nodiscard]] Readings read(std::size_t session, const RandomStream& noise, const RunDraw& draw,
                              const SampleSink& sink) const;
  [[nodiscard]] Eigen::Matrix3d uncertainty(const Eigen::Vector3d& offset_m) const;

  std::size_t num_samples_;
  double period_s_, amplitude_rad_s2_, torque_hz_, orbit_rate_rad_s_, sigma_m_s2_, range_m_s2_;
  double scale_deviation_;
  /// What d_l does to each reading of each session, without constant and drift: [session][axis][l].
  std::array<std::array<std::array<std::vector<double>, 3>, 3>, 3> regressors_;
  /// Σ regressor regressorᵀ over what one axis reads, 1/s⁴.
  std::array<Eigen::Matrix3d, 3> normal_of_axis_;
  Eigen::Matrix3d inverse_;  ///< Of the sum of these.
};

struct CentreOfMass {
  static constexpr std::string_view name = "grace-fo-com", version = "centre-of-mass-2",
                                    purpose =
                                        "Measures how well torques reveal the offset of an "
                                        "accelerometer from the centre of mass.",
                                    step_name = "torques", example_file = "grace-fo-com.toml";
  static constexpr std::uint64_t num_runs = 1000;
  static constexpr std::size_t batch_size = 1;

  double altitude_m = 490e3;
  double torque_rad_s2 = 1e-5;
  double torque_period_s = 12.0;
  double torque_duration_s = 180.0;
  double sample_period_s = 0.1;
  double noise_m_s2_rthz = 1e-10;
  double range_m_s2 = 5e-5;
  double offset_m = 50e-6;
  double scale = 0.01;
  double bias_m_s2 = 1e-6;
  double drag_m_s2 = 1e-7;
  double drift_m_s3 = 1e-10;
  double objective_m = 10e-6;

  static std::span<const SettingInfo<CentreOfMass>> infos() {
    using S = CentreOfMass;
    static const std::array<SettingInfo<S>, 13> infos{{
        {{"orbit.altitude_m", "of GRACE-FO, circular", range::between(1e5, 1e8)}, &S::altitude_m},
        {{"torque.acceleration_rad_s2", "amplitude; chosen", range::between(1e-12, 1.0)},
         &S::torque_rad_s2},
        {{"torque.period_s", "chosen", range::between(1e-3, 1e6)}, &S::torque_period_s},
        {{"torque.duration_s", "whole periods about each axis; chosen", range::between(1e-3, 1e6)},
         &S::torque_duration_s},
        {{"sensor.sample_period_s", "chosen", range::between(1e-3, 1e3)}, &S::sample_period_s},
        {{"sensor.noise_m_s2_rthz", "white, one-sided; GRACE-FO's order of size",
          range::between(0.0, 1.0)},
         &S::noise_m_s2_rthz},
        {{"sensor.range_m_s2", "a larger reading loses the run; chosen", range::positive},
         &S::range_m_s2},
        {{"deviation.offset_m", "of each axis; GROOPS' default offset", range::between(0.0, 1.0)},
         &S::offset_m},
        {{"deviation.scale", "of S from 1, each axis; Taiji-1: below 1 %",
          range::between(0.0, 0.1)},
         &S::scale},
        {{"deviation.bias_m_s2", "chosen", range::between(0.0, 1.0)}, &S::bias_m_s2},
        {{"deviation.drag_m_s2", "a_ng at the start; chosen", range::between(0.0, 1.0)},
         &S::drag_m_s2},
        {{"deviation.drift_m_s3", "of a_ng; chosen", range::between(0.0, 1.0)}, &S::drift_m_s3},
        {{"objective.offset_m", "published accuracy of GRACE-FO", range::positive},
         &S::objective_m},
    }};
    return infos;
  }
  static std::span<const DrawnQuantity> drawn() {
    static constexpr std::array<DrawnQuantity, 15> drawn{{{"offset_m.x", "m"},
                                                          {"offset_m.y", "m"},
                                                          {"offset_m.z", "m"},
                                                          {"scale.x", "1"},
                                                          {"scale.y", "1"},
                                                          {"scale.z", "1"},
                                                          {"bias_m_s2.x", "m/s²"},
                                                          {"bias_m_s2.y", "m/s²"},
                                                          {"bias_m_s2.z", "m/s²"},
                                                          {"drag_m_s2.x", "m/s²"},
                                                          {"drag_m_s2.y", "m/s²"},
                                                          {"drag_m_s2.z", "m/s²"},
                                                          {"drift_m_s3.x", "m/s³"},
                                                          {"drift_m_s3.y", "m/s³"},
                                                          {"drift_m_s3.z", "m/s³"}}};
    return drawn;
  }
  /// The drawn vectors, in the order of drawn().
  enum Drawn : std::size_t { offset, scales = 3, bias = 6, drag = 9, drift = 12 };

  void check() const {
    const double periods = torque_duration_s / torque_period_s;
    const double samples = torque_duration_s / sample_period_s;
    const std::string duration = detail::number_text(torque_duration_s);
    if (periods < 0.5 || std::abs(periods - std::round(periods)) > 1e-9) {
      throw ConfigError("torque.duration_s", duration, "must be whole periods");
    }
    if (std::abs(samples - std::round(samples)) > 1e-6 || samples > 1e6 ||
        sample_period_s > torque_period_s / 4.0) {
      throw ConfigError("sensor.sample_period_s", detail::number_text(sample_period_s),
                        "must divide torque.duration_s, into at most 1e6 samples, and be at most a "
                        "quarter of torque.period_s");
    }
  }
  [[nodiscard]] ResultSchema results() const {
    ResultSchema schema{.health = {{"peak_reading", "_m_s2", "m/s²"}},
                        .loss_causes = {"out_of_range"},
                        .loss_sessions = {"torque_x", "torque_y", "torque_z"}};
    constexpr std::array<std::string_view, 3> symbols{"d_x", "d_y", "d_z"};
    for (std::size_t i = 0; i < 3; ++i) {
      schema.quantities.push_back({.name = fmt::format("offset_{:c}", "xyz"[i]),
                                   .unit_suffix = "_m",
                                   .symbol = symbols[i],
                                   .unit = "m",
                                   .display_scale = 1e-6,
                                   .display_unit = "µm",
                                   .objective = objective_m,
                                   .has_standard_error = true});
    }
    return schema;
  }
  [[nodiscard]] std::int64_t num_rounds_max() const { return 1; }
  [[nodiscard]] std::vector<Dispersion> laws() const {
    std::vector<Dispersion> laws;
    for (const double deviation : {offset_m, scale, bias_m_s2, drag_m_s2, drift_m_s3}) {
      laws.insert(laws.end(), 3, normal_law(laws.size() == scales ? 1.0 : 0.0, deviation));
    }
    return laws;
  }
  [[nodiscard]] std::vector<double> truth(std::span<const double> drawn) const {
    return {drawn.begin() + offset, drawn.begin() + offset + 3};
  }
  [[nodiscard]] CentreOfMass reference() const { return *this; }

  using Simulator = Manoeuvres;
};

Vector3<double> vector_at(std::span<const double> values, std::size_t first) {
  return {values[first], values[first + 1], values[first + 2]};
}

double sum_of_products(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0.0;
  for (std::size_t k = 0; k < a.size(); ++k) sum += a[k] * b[k];
  return sum;
}

/// Subtracts the constant and the drift that fit best. About the middle of a session they are
/// orthogonal.
void remove_drift(std::vector<double>& signal) {
  const double middle = 0.5 * (static_cast<double>(signal.size()) - 1.0);
  double sum = 0.0, moment = 0.0, square = 0.0;
  for (std::size_t k = 0; k < signal.size(); ++k) {
    const double t = static_cast<double>(k) - middle;
    sum += signal[k];
    moment += t * signal[k];
    square += t * t;
  }
  const double constant = sum / static_cast<double>(signal.size()), slope = moment / square;
  for (std::size_t k = 0; k < signal.size(); ++k) {
    signal[k] -= constant + slope * (static_cast<double>(k) - middle);
  }
}

Manoeuvres::Manoeuvres(const CentreOfMass& settings)
    : num_samples_(static_cast<std::size_t>(
          std::round(settings.torque_duration_s / settings.sample_period_s))),
      period_s_(settings.sample_period_s),
      amplitude_rad_s2_(settings.torque_rad_s2),
      torque_hz_(1.0 / settings.torque_period_s),
      sigma_m_s2_(settings.noise_m_s2_rthz / std::sqrt(2.0 * settings.sample_period_s)),
      range_m_s2_(settings.range_m_s2),
      scale_deviation_(settings.scale) {
  orbit_rate_rad_s_ = orbit_rate_rad_s(settings.altitude_m);
  recording.groups = {
      {"sensor",
       "readings",
       {{"x", "m/s²", "", "y_x"}, {"y", "m/s²", "", "y_y"}, {"z", "m/s²", "", "y_z"}}}};
  for (const char* const name : {"torque_x", "torque_y", "torque_z"}) {
    recording.sessions.push_back({name, period_s_, num_samples_});
  }
  normal_of_axis_.fill(Eigen::Matrix3d::Zero());
  for (std::size_t session = 0; session < 3; ++session) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      auto& regressors = regressors_[session][axis];
      for (std::size_t k = 0; k < num_samples_; ++k) {
        const Matrix3<double> g = acceleration_gradient(rotation(session, k), orbit_rate_rad_s_);
        for (std::size_t l = 0; l < 3; ++l) regressors[l].push_back(g.row[axis][l]);
      }
      for (std::vector<double>& regressor : regressors) remove_drift(regressor);
      for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) {
          normal_of_axis_[axis](i, j) += sum_of_products(regressors[i], regressors[j]);
        }
      }
    }
  }
  const auto inverse = covariance(normal_of_axis_[0] + normal_of_axis_[1] + normal_of_axis_[2]);
  PROOFMASS_EXPECT(inverse.has_value());
  inverse_ = *inverse;
}

/// The torque of a session, a sine about its axis, beside the orbit's rate.
Rotation Manoeuvres::rotation(std::size_t session, std::size_t sample) const {
  const double omega = 2.0 * std::numbers::pi * torque_hz_;
  const SineCosine phase = sincos_turns(torque_hz_ * period_s_ * static_cast<double>(sample));
  Rotation rotation{.rate_rad_s = {0.0, -orbit_rate_rad_s_, 0.0}};
  rotation.acceleration_rad_s2[session] = amplitude_rad_s2_ * phase.sine;
  rotation.rate_rad_s[session] -= amplitude_rad_s2_ / omega * phase.cosine;
  rotation.angle_rad[session] = -amplitude_rad_s2_ / (omega * omega) * phase.sine;
  return rotation;
}

Manoeuvres::Readings Manoeuvres::read(std::size_t session, const RandomStream& noise,
                                      const RunDraw& draw, const SampleSink& sink) const {
  const auto offset = vector_at(draw.values, CentreOfMass::offset);
  const auto scale = vector_at(draw.values, CentreOfMass::scales);
  const auto bias = vector_at(draw.values, CentreOfMass::bias);
  const auto drag = vector_at(draw.values, CentreOfMass::drag);
  const auto drift = vector_at(draw.values, CentreOfMass::drift);
  Readings readings;
  for (std::size_t k = 0; k < num_samples_; ++k) {
    const double time_s = period_s_ * static_cast<double>(k);
    const auto deviates =
        normal_deviates(noise.block(static_cast<std::uint32_t>(session * num_samples_ + k)));
    const Matrix3<double> g = acceleration_gradient(rotation(session, k), orbit_rate_rad_s_);
    const Vector3<double> acceleration = g * offset + drag + time_s * drift;
    Vector3<double> reading = scaled(scale, acceleration) + bias;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      reading[axis] += sigma_m_s2_ * static_cast<double>(deviates[axis]);
      readings.axes[axis].push_back(reading[axis]);
    }
    readings.peak = largest_magnitude(reading, readings.peak);
    const std::array values{reading.x, reading.y, reading.z};
    if (sink) sink({.session = session, .time_s = time_s, .values = values});
  }
  return readings;
}

RunResult Manoeuvres::operator()(std::uint64_t seed, RunIndex run, const RunDraw& draw,
                                 const SampleSink& sink) const {
  const RandomStream noise(seed, run, stream_id("accelerometer"));
  Eigen::Vector3d correlation = Eigen::Vector3d::Zero();
  RunResult result{.num_rounds = 1, .health = {0.0}};
  for (std::size_t session = 0; session < 3; ++session) {
    Readings readings = read(session, noise, draw, sink);
    result.health[0] = std::max(result.health[0], readings.peak);
    if (readings.peak > range_m_s2_ && result.loss.cause == 0) {
      result.loss = {.cause = 1, .session = static_cast<std::uint32_t>(session + 1)};
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      remove_drift(readings.axes[axis]);
      for (int l = 0; l < 3; ++l) {
        correlation[l] += sum_of_products(regressors_[session][axis][l], readings.axes[axis]);
      }
    }
  }
  if (result.loss.cause != 0) {
    result.status = RunStatus::lost;
    result.num_rounds = 0;
    return result;
  }
  const Eigen::Vector3d offset_m = inverse_ * correlation;
  result.estimate.assign(offset_m.begin(), offset_m.end());
  set_uncertainty(result, uncertainty(offset_m));
  return result;
}

/// Of the noise, and of S: with Nᵢ the part of the normal matrix N that axis i reads, a deviation
/// of Sᵢ by 1 moves the estimate by N⁻¹ Nᵢ d.
Eigen::Matrix3d Manoeuvres::uncertainty(const Eigen::Vector3d& offset_m) const {
  Eigen::Matrix3d covariance = sigma_m_s2_ * sigma_m_s2_ * inverse_;
  for (const Eigen::Matrix3d& normal : normal_of_axis_) {
    const Eigen::Vector3d moved = scale_deviation_ * (inverse_ * (normal * offset_m));
    covariance += moved * moved.transpose();
  }
  return covariance;
}

}  // namespace

const Model& built_in_model() {
  static const SettingsModel<CentreOfMass> model;
  return model;
}

}  // namespace proofmass
