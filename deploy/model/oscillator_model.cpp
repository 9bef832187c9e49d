// A second model beside MICROSCOPE's, as small as a model can be: what runs campaigns must know
// neither of them. A driven, damped oscillator is read by a noisy accelerometer.
//
//     x'' + 2ζω₀x' + ω₀²x = F cos ωt,    y = S x'' + noise
//
// In the steady state S x'' = P cos ωt + Q sin ωt, and each run estimates P and Q by least squares.
// Over whole periods of the drive the cosine and the sine are orthogonal, so that of N samples
//
//     P = (2/N) Σ y cos ωt,    Q = (2/N) Σ y sin ωt,    each with the variance 2σ²/N.
//
// Campaigns with an objective of the amplitude √(P² + Q²) have that as a third quantity.

#include <algorithm>
#include <array>
#include <cmath>

#include "core/math/elementary.hpp"
#include "core/random/normal_deviates.hpp"
#include "core/random/stream.hpp"
#include "core/settings_model.hpp"

namespace proofmass {
namespace {

/// The law of a quantity that is drawn uniformly; a half width of 0: it is not drawn.
Dispersion around(double centre, double half_width) {
  return {.law = half_width == 0.0 ? Law::fixed : Law::uniform,
          .minimum = centre - half_width,
          .maximum = centre + half_width,
          .value = centre};
}

/// Everything of a definition that is a number; SI.
struct Oscillator {
  static constexpr std::string_view name = "oscillator", version = "oscillator-1",
                                    purpose =
                                        "Measures how well a driven oscillator is known from a "
                                        "noisy reading.",
                                    step_name = "periods", example_file = "oscillator.toml";
  static constexpr std::uint64_t num_runs = 100;
  static constexpr std::size_t batch_size = 4;

  double damping_ratio = 0.05;
  double drive_m_s2 = 1e-6;
  double drive_hz = 0.01;
  double natural_hz = 0.02;
  double natural_half_width_hz = 0.001;
  double scale_half_width = 0.01;
  double noise_m_s2 = 1e-9;
  double range_m_s2 = 1e-6;
  double num_periods = 1000;
  double in_phase_objective_m_s2 = 1e-10;
  double amplitude_objective_m_s2 = 0.0;

  static std::span<const SettingInfo<Oscillator>> infos() {
    using S = Oscillator;
    constexpr Range rate = range::between(1e-6, 1e6), size = range::between(0.0, 1e6);
    static const std::array<SettingInfo<S>, 11> infos{{
        {{"oscillator.damping_ratio", "ζ", range::positive}, &S::damping_ratio},
        {{"oscillator.drive_m_s2", "F", size}, &S::drive_m_s2},
        {{"oscillator.drive_hz", "ω/2π", rate}, &S::drive_hz},
        {{"oscillator.natural_hz", "ω₀/2π", rate}, &S::natural_hz},
        {{"oscillator.natural_half_width_hz", "drawn uniformly; 0: not drawn", range::not_negative},
         &S::natural_half_width_hz},
        {{"sensor.scale_half_width", "of S about 1, likewise", range::between(0.0, 1.0)},
         &S::scale_half_width},
        {{"sensor.noise_m_s2", "σ, of a sample", size}, &S::noise_m_s2},
        {{"sensor.range_m_s2", "a larger reading loses the run", range::positive}, &S::range_m_s2},
        {{"sensor.periods", "N/16", range::between(1.0, 1e6)}, &S::num_periods},
        {{"objective.in_phase_m_s2", "", range::positive}, &S::in_phase_objective_m_s2},
        {{"objective.amplitude_m_s2", "0: it is no quantity", range::not_negative},
         &S::amplitude_objective_m_s2},
    }};
    return infos;
  }
  static std::span<const DrawnQuantity> drawn() {
    static constexpr std::array<DrawnQuantity, 2> drawn{
        {{"natural_frequency_hz", "Hz"}, {"scale_factor", "1"}}};
    return drawn;
  }
  void check() const {}
  [[nodiscard]] ResultSchema results() const;
  [[nodiscard]] std::int64_t num_rounds_max() const { return 1; }
  [[nodiscard]] std::vector<Dispersion> laws() const {
    return {around(natural_hz, natural_half_width_hz), around(1.0, scale_half_width)};
  }
  [[nodiscard]] std::vector<double> truth(std::span<const double> drawn) const {
    // x = a cos ωt + b sin ωt, both over F/ω²; r is ω₀/ω.
    const double r = drawn[0] / drive_hz;
    const double stiff = r * r - 1.0, loss = 2.0 * damping_ratio * r;
    const double amplitude = -drawn[1] * drive_m_s2 / (stiff * stiff + loss * loss);
    return with_amplitude(amplitude * stiff, amplitude * loss);
  }
  [[nodiscard]] Oscillator reference() const { return *this; }

  /// The values of all quantities.
  [[nodiscard]] std::vector<double> with_amplitude(double in_phase, double quadrature) const {
    std::vector<double> values{in_phase, quadrature};
    if (amplitude_objective_m_s2 > 0.0) {
      values.push_back(std::sqrt(in_phase * in_phase + quadrature * quadrature));
    }
    return values;
  }

  using Simulator = class Readings;
};

ResultSchema Oscillator::results() const {
  const auto quantity = [](const char* quantity_name, std::string_view symbol) {
    return Quantity{.name = quantity_name,
                    .unit_suffix = "_m_s2",
                    .symbol = symbol,
                    .unit = "m/s²",
                    .display_scale = 1e-9,
                    .display_unit = "nm/s²"};
  };
  ResultSchema schema{.quantities = {quantity("in_phase", "P"), quantity("quadrature", "Q")},
                      .health = {{"peak_reading", "_m_s2", "m/s²"}},
                      .loss_causes = {"out_of_range"},
                      .loss_sessions = {"steady_state"},
                      .published_source = "made up for tests"};
  schema.quantities[0].objective = in_phase_objective_m_s2;
  schema.quantities[0].published = PublishedAccuracy{3e-11, 1e-11, 1e-11};
  schema.quantities[1].has_standard_error = true;
  if (amplitude_objective_m_s2 > 0.0) {
    schema.quantities.push_back(quantity("amplitude", "√(P² + Q²)"));
    schema.quantities[2].objective = amplitude_objective_m_s2;
  }
  return schema;
}

constexpr std::uint32_t samples_per_period = 16;

/// Simulates the readings and fits them.
class Readings {
 public:
  explicit Readings(const Oscillator& settings) : settings_(settings) {
    const double period_s = 1.0 / (samples_per_period * settings.drive_hz);
    recording.groups = {{"sensor", "what the accelerometer reads", {{"reading", "m/s²", "", "y"}}},
                        {"motion", "what the mass does", {{"acceleration", "m/s²", "", "S x''"}}}};
    recording.sessions = {{"steady_state", period_s, num_samples()}};
    recording.spectra = {expected(period_s)};
  }

  Recording recording;

  [[nodiscard]] int num_steps() const { return static_cast<int>(settings_.num_periods); }
  [[nodiscard]] RunResult operator()(std::uint64_t seed, RunIndex run, const RunDraw& draw,
                                     const SampleSink& sink) const;

 private:
  [[nodiscard]] std::uint32_t num_samples() const {
    return static_cast<std::uint32_t>(num_steps()) * samples_per_period;
  }

  /// The drive's line over white noise: 2σ²T at all frequencies.
  [[nodiscard]] ExpectedSpectrum expected(double period_s) const {
    const double drive_hz = settings_.drive_hz, sigma = settings_.noise_m_s2;
    LineFit fit{.num_samples = num_samples(),
                .num_dropped = num_samples() / 10,
                .sample_period_s = period_s,
                .filter = band_pass(drive_hz / 3.0, drive_hz * 3.0, period_s),
                .fit_hz = {drive_hz},
                .known_hz = {}};
    return {.fits = {std::move(fit)},
            .noise_psd = [density = 2.0 * sigma * sigma * period_s](double) { return density; },
            .noise_meaning = "The noise model is white."};
  }

  Oscillator settings_;
};

RunResult Readings::operator()(std::uint64_t seed, RunIndex run, const RunDraw& draw,
                               const SampleSink& sink) const {
  const double sigma = settings_.noise_m_s2;
  const RandomStream noise(seed, run, stream_id("accelerometer"));
  double in_phase = 0.0, quadrature = 0.0, peak = 0.0;
  std::array<float, 4> deviates{};
  for (std::uint32_t k = 0; k < num_samples(); ++k) {
    if (k % 4 == 0) deviates = normal_deviates(noise.block(k / 4));
    const SineCosine drive = sincos_turns((k % samples_per_period) / double{samples_per_period});
    const double acceleration = draw.truth[0] * drive.cosine + draw.truth[1] * drive.sine;
    const double reading = acceleration + sigma * static_cast<double>(deviates[k % 4]);
    const std::array values{reading, acceleration};
    if (sink) sink({.time_s = k * recording.sessions[0].sample_period_s, .values = values});
    in_phase += reading * drive.cosine;
    quadrature += reading * drive.sine;
    peak = std::max(peak, std::abs(reading));
  }
  const double weight = 2.0 / num_samples();
  if (peak > settings_.range_m_s2) {
    return {.run = run,
            .status = RunStatus::lost,
            .health = {peak},
            .loss = {.cause = 1, .session = 1}};
  }
  return {.run = run,
          .num_rounds = 1,
          .estimate = settings_.with_amplitude(weight * in_phase, weight * quadrature),
          .standard_error = {sigma * std::sqrt(weight)},
          .health = {peak}};
}

}  // namespace

const Model& built_in_model() {
  static const SettingsModel<Oscillator> model;
  return model;
}

}  // namespace proofmass
