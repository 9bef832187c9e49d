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

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>

#include "core/campaign/dispersion.hpp"
#include "core/campaign/law_set.hpp"
#include "core/campaign/recording.hpp"
#include "core/definition/document.hpp"
#include "core/definition/entry.hpp"
#include "core/math/elementary.hpp"
#include "core/model.hpp"
#include "core/random/normal_deviates.hpp"
#include "core/random/stream.hpp"

namespace proofmass {
namespace {

constexpr int samples_per_period = 16;
constexpr std::array<DrawnQuantity, 2> drawn_quantities{
    {{"natural_frequency_hz", "Hz"}, {"scale_factor", "1"}}};

/// Everything of a definition that is a number, and nothing else; SI.
struct Oscillator {
  double damping_ratio = 0.05;
  double drive_m_s2 = 1e-6;
  double drive_hz = 0.01;
  double natural_hz = 0.02;
  double natural_half_width_hz = 0.001;  ///< Drawn uniformly; 0: not drawn.
  double scale_half_width = 0.01;        ///< Likewise, about 1.
  double noise_m_s2 = 1e-9;              ///< Standard deviation of a sample.
  double range_m_s2 = 1e-6;              ///< A larger reading loses the run.
  double num_periods = 1000;
  double in_phase_objective_m_s2 = 1e-10;
  double amplitude_objective_m_s2 = 0.0;  ///< 0: the amplitude is no quantity.
};

struct Field {
  FieldInfo info;
  double Oscillator::*value;
};

const std::array<Field, 11> fields{{
    {{"oscillator.damping_ratio", "ζ", range::positive}, &Oscillator::damping_ratio},
    {{"oscillator.drive_m_s2", "F", range::between(0.0, 1e6)}, &Oscillator::drive_m_s2},
    {{"oscillator.drive_hz", "ω/2π", range::between(1e-6, 1e6)}, &Oscillator::drive_hz},
    {{"oscillator.natural_hz", "ω₀/2π", range::between(1e-6, 1e6)}, &Oscillator::natural_hz},
    {{"oscillator.natural_half_width_hz", "", range::not_negative},
     &Oscillator::natural_half_width_hz},
    {{"sensor.scale_half_width", "of S", range::between(0.0, 1.0)}, &Oscillator::scale_half_width},
    {{"sensor.noise_m_s2", "σ", range::between(0.0, 1e6)}, &Oscillator::noise_m_s2},
    {{"sensor.range_m_s2", "", range::positive}, &Oscillator::range_m_s2},
    {{"sensor.periods", "N/16", range::between(1.0, 1e6)}, &Oscillator::num_periods},
    {{"objective.in_phase_m_s2", "", range::positive}, &Oscillator::in_phase_objective_m_s2},
    {{"objective.amplitude_m_s2", "", range::not_negative}, &Oscillator::amplitude_objective_m_s2},
}};

Dispersion around(double centre, double half_width) {
  return {.law = half_width == 0.0 ? Law::fixed : Law::uniform,
          .minimum = centre - half_width,
          .maximum = centre + half_width,
          .value = centre};
}

class OscillatorCampaign final : public Campaign {
 public:
  OscillatorCampaign() { name = "oscillator"; }

  Oscillator oscillator;

  [[nodiscard]] const Model& model() const override { return built_in_model(); }
  void validate() const override {
    check_identity(*this);
    check_table_columns({}, *this);
    for (const Field& field : fields) check_field(field.info, oscillator.*field.value);
  }
  [[nodiscard]] std::unique_ptr<Campaign> clone() const override {
    return std::make_unique<OscillatorCampaign>(*this);
  }
  [[nodiscard]] std::unique_ptr<const Plan> prepare() const override;
  /// All of the campaign as TOML, in the one form that campaign_of() takes.
  [[nodiscard]] Definition definition(TableColumns) const override {
    return {.text = detail::text_of(entries(), "")};
  }
  [[nodiscard]] std::vector<DefinitionItem> items() const override {
    return detail::items_of(entries());
  }
  [[nodiscard]] std::vector<DefinitionDifference> differences_from(
      const Campaign& other) const override {
    return detail::differences_between(entries(),
                                       dynamic_cast<const OscillatorCampaign&>(other).entries());
  }
  [[nodiscard]] bool has_amplitude() const { return oscillator.amplitude_objective_m_s2 > 0.0; }
  [[nodiscard]] ResultSchema results() const override;
  [[nodiscard]] std::vector<double> objectives() const override {
    std::vector<double> objectives{oscillator.in_phase_objective_m_s2,
                                   std::numeric_limits<double>::infinity()};
    if (has_amplitude()) objectives.push_back(oscillator.amplitude_objective_m_s2);
    return objectives;
  }
  [[nodiscard]] std::int64_t num_rounds_max() const override { return 1; }
  [[nodiscard]] std::vector<std::size_t> table_quantities() const override { return {}; }

  [[nodiscard]] RunDraw draw(RunIndex run) const override {
    const auto draw_of = [&](std::size_t i, double centre, double half_width) {
      return draw_value(around(centre, half_width), drawn_quantities[i].name, seed, run, 0, 0.0);
    };
    const double natural_hz = draw_of(0, oscillator.natural_hz, oscillator.natural_half_width_hz);
    const double scale = draw_of(1, 1.0, oscillator.scale_half_width);
    // x = a cos ωt + b sin ωt, both over F/ω²; r is ω₀/ω.
    const double r = natural_hz / oscillator.drive_hz;
    const double stiff = r * r - 1.0, loss = 2.0 * oscillator.damping_ratio * r;
    const double amplitude = -scale * oscillator.drive_m_s2 / (stiff * stiff + loss * loss);
    return {.num_draws = 1,
            .values = {natural_hz, scale},
            .truth = with_amplitude(amplitude * stiff, amplitude * loss)};
  }

  /// The values of all quantities.
  [[nodiscard]] std::vector<double> with_amplitude(double in_phase, double quadrature) const {
    std::vector<double> values{in_phase, quadrature};
    if (has_amplitude()) {
      values.push_back(std::sqrt(in_phase * in_phase + quadrature * quadrature));
    }
    return values;
  }

 private:
  /// The keys of its campaign file.
  [[nodiscard]] std::vector<detail::Entry> entries() const {
    std::vector<detail::Entry> entries = detail::campaign_entries(*this);
    for (const Field& field : fields) {
      if (field.value == &Oscillator::amplitude_objective_m_s2 && !has_amplitude()) continue;
      entries.push_back(detail::real_entry(field.info.path, oscillator.*field.value));
    }
    return entries;
  }
};

class OscillatorPlan final : public Plan {
 public:
  explicit OscillatorPlan(const OscillatorCampaign& campaign) : campaign_(campaign) {
    const double drive_hz = campaign.oscillator.drive_hz;
    recording_.groups = {{"sensor", "what the accelerometer reads", {{"reading", "m/s²", "", "y"}}},
                         {"motion", "what the mass does", {{"acceleration", "m/s²", "", "S x''"}}}};
    recording_.sessions = {{.name = "steady_state",
                            .sample_period_s = 1.0 / (samples_per_period * drive_hz),
                            .num_samples = num_samples()}};
    recording_.spectra = {expected_reading()};
  }

  [[nodiscard]] std::vector<RunResult> simulate_batch(
      std::span<const RunRequest> requests, InstructionSet,
      const std::function<void(int)>& progress) const override {
    std::vector<RunResult> results;
    for (const RunRequest& request : requests) results.push_back(simulate(request.run, {}));
    if (progress) progress(num_steps());
    return results;
  }
  [[nodiscard]] RunResult replay(const RunRequest& request, const SampleSink& sink,
                                 const std::function<void(int)>& progress) const override {
    RunResult result = simulate(request.run, sink);
    if (progress) progress(num_steps());
    return result;
  }
  [[nodiscard]] const Recording& recording() const override { return recording_; }
  [[nodiscard]] int num_steps() const override {
    return static_cast<int>(campaign_.oscillator.num_periods);
  }

 private:
  [[nodiscard]] std::uint32_t num_samples() const {
    return static_cast<std::uint32_t>(num_steps()) * samples_per_period;
  }

  /// The drive's line over white noise: 2σ²T at all frequencies.
  [[nodiscard]] ExpectedSpectrum expected_reading() const {
    const double drive_hz = campaign_.oscillator.drive_hz, sigma = campaign_.oscillator.noise_m_s2;
    const double period_s = recording_.sessions[0].sample_period_s;
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

  /// @param sink  Gets each sample if there is one.
  [[nodiscard]] RunResult simulate(RunIndex run, const SampleSink& sink) const {
    const double sigma = campaign_.oscillator.noise_m_s2;
    const RunDraw draw = campaign_.draw(run);
    const RandomStream noise(campaign_.seed, run, stream_id("accelerometer"));
    double in_phase = 0.0, quadrature = 0.0, peak = 0.0;
    std::array<float, 4> deviates{};
    for (std::uint32_t k = 0; k < num_samples(); ++k) {
      if (k % 4 == 0) deviates = normal_deviates(noise.block(k / 4));
      const SineCosine drive = sincos_turns((k % samples_per_period) / double{samples_per_period});
      const double acceleration = draw.truth[0] * drive.cosine + draw.truth[1] * drive.sine;
      const double reading = acceleration + sigma * static_cast<double>(deviates[k % 4]);
      const std::array values{reading, acceleration};
      if (sink) sink({.time_s = k * recording_.sessions[0].sample_period_s, .values = values});
      in_phase += reading * drive.cosine;
      quadrature += reading * drive.sine;
      peak = std::max(peak, std::abs(reading));
    }
    const double weight = 2.0 / num_samples();
    RunResult result{.run = run, .num_draws = 1, .truth = draw.truth, .health = {peak}};
    if (peak > campaign_.oscillator.range_m_s2) {
      result.status = RunStatus::lost;
      result.loss = {.cause = 1, .session = 1};
      return result;
    }
    result.num_rounds = 1;
    result.estimate = campaign_.with_amplitude(weight * in_phase, weight * quadrature);
    result.standard_error = {sigma * std::sqrt(weight)};
    return result;
  }

  OscillatorCampaign campaign_;
  Recording recording_;
};

std::unique_ptr<const Plan> OscillatorCampaign::prepare() const {
  return std::make_unique<const OscillatorPlan>(*this);
}

ResultSchema OscillatorCampaign::results() const {
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
                      .num_draws_max = 1,
                      .published_source = "made up for tests"};
  schema.quantities[0].published = PublishedAccuracy{3e-11, 1e-11, 1e-11};
  schema.quantities[1].has_standard_error = true;
  if (has_amplitude()) schema.quantities.push_back(quantity("amplitude", "√(P² + Q²)"));
  return schema;
}

std::unique_ptr<OscillatorCampaign> read(Document& document) {
  auto campaign = std::make_unique<OscillatorCampaign>();
  document.read("campaign.name", campaign->name);
  document.read("campaign.seed", campaign->seed, range::not_negative);
  document.read("campaign.runs", campaign->num_runs, range::between(1, double{num_runs_max}));
  for (const Field& field : fields) {
    document.read(std::string(field.info.path), campaign->oscillator.*field.value,
                  field.info.range);
  }
  document.check();
  try {
    campaign->validate();
  } catch (const ConfigError& error) {
    throw document.located(error);
  }
  return campaign;
}

class OscillatorModel final : public Model {
 public:
  [[nodiscard]] std::string_view version() const override { return "oscillator-1"; }
  [[nodiscard]] std::string_view purpose() const override {
    return "Measures how well a driven oscillator is known from a noisy reading.";
  }

  [[nodiscard]] ResultSchema results_of(std::string_view definition,
                                        std::string_view /*version*/) const override {
    try {
      Document document("definition", definition, {});
      return read(document)->results();
    } catch (const DefinitionError&) {
      return OscillatorCampaign().results();
    }
  }
  [[nodiscard]] std::span<const DataTableSchema> tables() const override { return {}; }
  [[nodiscard]] std::span<const DrawnQuantity> drawn() const override { return drawn_quantities; }
  [[nodiscard]] std::string_view step_name() const override { return "periods"; }
  [[nodiscard]] std::size_t batch_size() const override { return 4; }

  [[nodiscard]] std::uint64_t reference_digest(InstructionSet set) const override {
    const RunRequest request{RunIndex{0}, {}};
    const RunResult result = OscillatorCampaign().prepare()->simulate_batch({&request, 1}, set)[0];
    return std::bit_cast<std::uint64_t>(result.estimate[0]) ^
           std::rotl(std::bit_cast<std::uint64_t>(result.estimate[1]), 1);
  }
  [[nodiscard]] std::unique_ptr<Campaign> campaign_of(Definition definition, TableColumns,
                                                      std::string_view source) const override {
    Document document(std::string(source), definition.text, {});
    auto campaign = read(document);
    if (campaign->definition(TableColumns::included) == definition) return campaign;
    throw DefinitionError(fmt::format("{}: is no definition of an oscillator", source));
  }
  [[nodiscard]] std::unique_ptr<Campaign> read_campaign(Document& document,
                                                        DataFiles&) const override {
    return read(document);
  }
  [[nodiscard]] std::string example() const override {
    return OscillatorCampaign().definition({}).text;
  }
  [[nodiscard]] std::string_view example_file() const override { return "oscillator.toml"; }
};

}  // namespace

const Model& built_in_model() {
  static const OscillatorModel oscillator;
  return oscillator;
}

}  // namespace proofmass
