#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "core/random/stream.hpp"
#include "core/settings_model.hpp"
#include "fourier.hpp"
#include "kinematics.hpp"

namespace proofmass {

// Three accelerometers on one line along x, the second in the middle, in a satellite that is shaken
// about all axes:
//
//     aᵢ = G rᵢ + a_ng,    yᵢ = Mᵢ aᵢ + Kᵢ (aᵢ ∘ aᵢ) + Wᵢ ω̇ + nᵢ,    Mᵢ = I + dMᵢ
//
// with G of kinematics.hpp. Half differences have the index d13, half sums c13. The second sensor
// is where all places count from, and has no coupling W; the distance of the outer two is known.

/// An unknown of the sensors by its number; those of one kind are neighbours.
struct Unknowns {
  static constexpr std::size_t matrix = 0;      ///< dM₁, dM₂ and dM₃, rows first.
  static constexpr std::size_t quadratic = 27;  ///< K₁, K₂ and K₃, s²/m.
  static constexpr std::size_t coupling = 36;   ///< W₁ and W₃: (y,x), (z,y) and (y,z), m.
  static constexpr std::size_t place = 42;      ///< δr₁, then y and z of δr₃, m.
  static constexpr std::size_t count = 47;
};

/// Where the three elements of W are: {row, column}.
inline constexpr std::array<std::array<std::size_t, 2>, 3> coupling_places{
    {{1, 0}, {2, 1}, {1, 2}}};

/// @param unknowns  Shape [Unknowns::count].
/// @param length_m  From the first sensor to the third.
[[nodiscard]] std::array<Accelerometer, 3> sensors_of(std::span<const double> unknowns,
                                                      double length_m);

/// A quantity of the results: a sum of unknowns that the observations tell.
struct Combination {
  std::vector<std::pair<std::size_t, double>> terms;  ///< Unknown and coefficient.

  [[nodiscard]] double of(std::span<const double> unknowns) const;
};

/// Numbers of the campaign file.
struct Gradiometer {
  static constexpr std::string_view name = "nggm-three", version = "gradiometer-3",
                                    purpose =
                                        "Measures how well shaking a satellite calibrates a "
                                        "gradiometer of three accelerometers.",
                                    step_name = "estimations", example_file = "nggm-three.toml";
  static constexpr std::uint64_t num_runs = 1000;
  static constexpr std::size_t batch_size = 1;

  double altitude_m = 396e3;
  double length_m = 0.6;
  double duration_s = 86400.0;
  double linear_m_s2_rthz = 2e-6;
  double angular_rad_s2_rthz = 2e-6;
  double lowest_hz = 1e-5;
  double drag_m_s2 = 1e-8;
  double noise_factor = 1.0;
  double matrix = 1e-3;
  double quadratic_s2_m = 10.0;
  double coupling_m = 1e-4;
  double place_m = 1e-3;
  double matrix_objective = 5e-7;
  double quadratic_objective_s2_m = 1.5;
  double coupling_objective_m = 1e-5;
  double place_objective_m = 3e-6;
  double ratio_objective = 0.15;

  static std::span<const SettingInfo<Gradiometer>> infos();
  static std::span<const DrawnQuantity> drawn();
  void check() const;
  [[nodiscard]] ResultSchema results() const;
  [[nodiscard]] std::int64_t num_rounds_max() const { return 10; }
  [[nodiscard]] std::vector<Dispersion> laws() const;
  [[nodiscard]] std::vector<double> truth(std::span<const double> drawn) const;
  [[nodiscard]] Gradiometer reference() const;

  [[nodiscard]] double orbit_rate_rad_s() const { return proofmass::orbit_rate_rad_s(altitude_m); }
  [[nodiscard]] std::size_t num_samples() const { return static_cast<std::size_t>(duration_s); }

  using Simulator = class Shaking;
};

/// The combinations that are estimated, in the order of the results.
[[nodiscard]] const std::vector<Combination>& combinations();

using Amplitudes = std::vector<ComplexDouble>;

/// Records of equally spaced samples; all signals are lines at multiples of 1 / (their length).
struct Sampling {
  FourierTransform transform;
  double period_s;

  [[nodiscard]] double spacing_hz() const {
    return 1.0 / (period_s * static_cast<double>(transform.size()));
  }
};

/// What moves the satellite: amplitudes of the lines of each axis.
struct Motion {
  std::array<Amplitudes, 3> linear_m_s2;  ///< Of a_ng.
  std::array<Amplitudes, 3> angular_rad_s2;
};

/// Shaking about and along all axes, and the noise of the thrusters.
[[nodiscard]] Motion shaken(const Gradiometer& settings, const Sampling& sampling,
                            std::uint64_t seed, RunIndex run);

/// Without shaking: noise of the thrusters, which take the drag away along x, and drag along y and
/// z, a line at the orbit's frequency. The satellite turns evenly.
[[nodiscard]] Motion in_science(const Gradiometer& settings, const Sampling& sampling,
                                std::uint64_t seed, RunIndex run);

/// A reading of each sensor and the satellite's rotation, in each sample.
struct Measurement {
  std::array<std::vector<Vector3<double>>, 3> readings_m_s2;
  std::vector<Rotation> rotation;          ///< With its noise.
  std::vector<Vector3<double>> a_ng_m_s2;  ///< The true one, which no estimate may use.
};

/// One-sided amplitude spectral densities at a frequency above 0.
[[nodiscard]] double accelerometer_noise_m_s2_rthz(double frequency_hz);
/// Of angular accelerometers and star trackers together.
[[nodiscard]] double angular_noise_rad_s2_rthz(double frequency_hz);

/// Simulates what sensors measure, with noise: lines with random amplitudes.
/// @param unknowns  True values, shape [Unknowns::count].
/// @param noises    The stream of the noise.
[[nodiscard]] Measurement measure(const Gradiometer& settings, const Sampling& sampling,
                                  const Motion& motion, std::span<const double> unknowns,
                                  const RandomStream& noises);

/// What the fit of a measurement finds.
struct Fit {
  std::vector<double> unknowns;
  Eigen::MatrixXd covariance;  ///< Of unknowns; empty if some are not observed.
  std::uint32_t num_rounds = 0;
  bool has_converged = false;
};

/// Estimates all unknowns by least squares of Gauss and Newton, weighted by the noise's spectra.
[[nodiscard]] Fit fit(const Gradiometer& settings, const FourierTransform& transform,
                      const Measurement& measurement);

/// What the calibration is for: a_ng in science data, judged by the power of its residual between
/// 0.1 and 1 mHz, over the power that is required there. Each is below 1 if the requirement is met.
struct ScienceRatios {
  double calibrated = 0.0;
  double uncalibrated = 0.0;  ///< All unknowns taken to be 0.
  double floor = 0.0;         ///< With the true values: what noise alone makes.
};
[[nodiscard]] ScienceRatios science_ratios(const Gradiometer& settings,
                                           std::span<const double> truth,
                                           std::span<const double> estimate, std::uint64_t seed,
                                           RunIndex run);

/// Simulates and fits.
class Shaking {
 public:
  explicit Shaking(const Gradiometer& settings);

  Recording recording;

  [[nodiscard]] int num_steps() const { return 1; }
  [[nodiscard]] RunResult operator()(std::uint64_t seed, RunIndex run, const RunDraw& draw,
                                     const SampleSink& sink) const;

 private:
  Gradiometer settings_;
  Sampling sampling_;
};

}  // namespace proofmass
