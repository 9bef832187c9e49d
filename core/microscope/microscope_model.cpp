#include "core/microscope/microscope_model.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <memory>
#include <numbers>
#include <span>
#include <string>
#include <tuple>
#include <utility>

#include "core/error.hpp"
#include "core/math/elementary.hpp"
#include "core/microscope/campaign/budget.hpp"
#include "core/microscope/campaign/loop_margins.hpp"
#include "core/microscope/campaign/microscope_campaign.hpp"
#include "core/microscope/campaign/regressor_lines.hpp"
#include "core/microscope/campaign/shift_bounds.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "core/microscope/definition/made_environment.hpp"
#include "core/microscope/estimation/methods.hpp"
#include "core/microscope/instrument/instrument.hpp"
#include "core/microscope/planning/plan_study.hpp"
#include "core/microscope/simulation/reference_digest.hpp"
#include "core/microscope/simulation/run.hpp"

namespace proofmass {

const Model& MicroscopeCampaign::model() const { return microscope_model(); }

std::unique_ptr<Campaign> MicroscopeCampaign::clone() const {
  return std::make_unique<MicroscopeCampaign>(*this);
}

std::unique_ptr<const Plan> MicroscopeCampaign::prepare() const {
  return std::make_unique<const RunPlan>(*this);
}

Definition MicroscopeCampaign::definition(TableColumns columns) const {
  return definition_of(*this, columns);
}

namespace {

/// N of `hardy2013-N`; 0 of any other version.
int number_of(std::string_view version) {
  constexpr std::string_view name = "hardy2013-";
  if (!version.starts_with(name)) return 0;
  int number = 0;
  const char* const end = version.data() + version.size();
  const auto [stop, error] = std::from_chars(version.data() + name.size(), end, number);
  return error == std::errc() && stop == end ? number : 0;
}

/// With the columns of standard errors whatever the method is, as databases of all campaigns had
/// them from the first; where sessions test, of what has them, and the quantities of the test.
/// Without noise there is nothing that standard errors could be of.
ResultSchema scenario_results(const Scenario& scenario, std::string_view version) {
  constexpr int with_session_fits = 6, with_test_residual = 10, of_noise_alone = 11;
  const bool has_tests = scenario.has_tests();
  const bool has_errors = estimation_method(scenario.estimation.method).has_standard_errors &&
                          (scenario.noise.scale > 0.0 || number_of(version) < of_noise_alone);
  ResultSchema schema = has_tests && !has_errors ? microscope_results() : results_with_errors();
  if (has_tests) {
    schema.quantities.insert(schema.quantities.end(), test_quantities().begin(),
                             test_quantities().end());
  }
  if (!scenario.has_plain_loops()) {
    schema.health.insert(schema.health.end(), margin_quantities().begin(),
                         margin_quantities().end());
  }
  schema.budget_level = budget_level({});
  if (has_tests && number_of(version) >= with_test_residual) {
    schema.health.push_back(test_residual_quantity());
    schema.budget_level = budget_level(scenario);
  }
  for (const BudgetEntryInfo& info : budget_entry_infos()) schema.budget_terms.push_back(info.name);
  if (has_errors && number_of(version) >= with_session_fits) {
    add_session_fits(scenario.sessions, schema);
  }
  return schema;
}

}  // namespace

ResultSchema MicroscopeCampaign::results() const {
  return scenario_results(scenario, model_version);
}

namespace {

/// Health of the loops is measured where nothing is shaken.
std::string unwatched_note(const Scenario& scenario) {
  const auto is_quiet = [](const Session& session) {
    return !is_test(session) && session.excitations.empty();
  };
  if (scenario.noise.scale == 0.0 || std::ranges::any_of(scenario.sessions, is_quiet)) return {};
  return "no session watches the noise of the loops, which may move every estimate: add one "
         "without excitations";
}

std::string loops_note(const Scenario& scenario) {
  if (scenario.has_plain_loops()) return {};
  const std::vector<AxisMargins> of_axes = loop_margins(scenario, make_instrument({}));
  const auto axis_text = [](const AxisMargins& of) {
    const std::string_view in = of.resonator_of.empty() ? "" : " in ";
    return fmt::format("{} {}{}{}", name_of(of.loop), name_of(of.axis), in, of.resonator_of);
  };
  const auto by_gain = [](const AxisMargins& of) { return of.margins.gain; };
  const auto by_phase = [](const AxisMargins& of) { return of.margins.phase_rad; };
  const AxisMargins gain = *std::ranges::min_element(of_axes, {}, by_gain);
  const AxisMargins phase = *std::ranges::min_element(of_axes, {}, by_phase);
  const std::string_view of_realism =
      scenario.realism ? "; errors have what [realism] adds, and standard errors do not" : "";
  return fmt::format(
      "loops that are not the paper's: with a perfect instrument, the least margin of gain is a "
      "factor of {:.3g} ({}), that of phase {:.3g}° ({}); each run has its own, gain_margin and "
      "phase_margin_rad{}",
      gain.margins.gain, axis_text(gain), phase.margins.phase_rad * 180.0 / std::numbers::pi,
      axis_text(phase), of_realism);
}

/// The band-pass lets no drift through, but answers its beginning.
std::string drift_note(const Scenario& scenario) {
  constexpr double num_decays = 7.0;  // e⁻⁷ is a thousandth.
  if (!scenario.realism || estimation_method(scenario.estimation.method).has_standard_errors)
    return {};
  const auto& drifts = scenario.realism->bias_drift_m_s3;
  if (std::ranges::all_of(drifts, [](double drift) { return drift == 0.0; })) return {};
  double longest_s = 0.0;
  for (const Session& session : scenario.sessions) {
    if (is_test(session) || session.fit_lines.empty()) continue;
    longest_s = std::max(longest_s, band_decay_s(scenario, session));
  }
  const double least_s = num_decays * longest_s;
  if (scenario.estimation.transient_s >= least_s) return {};
  return fmt::format(
      "biases drift, and with estimation.transient_s = {} s the filter's answer to the beginning "
      "of "
      "a record is in the estimates; after {:.0f} s a thousandth of it is left",
      scenario.estimation.transient_s, std::ceil(least_s));
}

/// Whether the gradient's harmonic at 4 f_orb, where it is not fitted, shifts a_c13 by more than
/// 1/50 of its objective, 1.8e-5. Measured without noise, in inertial pointing: by 0.3 e³/N rad in
/// N orbits, of which there are 3 or more, and by 1.5e-5 at the bounds for shorter sessions; a_c12
/// is not shifted.
bool shifts_a_c13(double e, int num_orbits) {
  if (num_orbits == 1) return e > 0.012;
  if (num_orbits == 2) return e > 0.035;
  return 0.3 * e * e * e > 1.8e-5 * num_orbits;
}

/// The gradient's harmonics at 2, 3 and 4 f_orb are as 1, 7e/2 and 17e²/2.
std::string eccentricity_note(const Scenario& scenario) {
  const double e = scenario.orbit.eccentricity;
  const auto has = [](const std::vector<LineMultiple>& lines, double orbital) {
    return std::ranges::find(lines, LineMultiple{orbital, 1.0}) != lines.end();
  };
  std::vector<std::string_view> sessions;
  for (const Session& session : scenario.sessions) {
    if (session.target != SessionTarget::a_c13 || !shifts_a_c13(e, session.num_orbits)) continue;
    const bool is_complete = has(session.known_lines, 4.0) && has(session.known_lines, -4.0);
    if (has(session.fit_lines, 2.0) && !is_complete) sessions.push_back(session.name);
  }
  if (sessions.empty()) return {};
  return fmt::format(
      "orbit.eccentricity = {}: the gradient's harmonic at 4 f_orb is {:.2g} % of that at 2 f_orb, "
      "and shifts a_c13 of sessions whose known_lines lack [4, 1] and [-4, 1]: {}",
      e, 100.0 * 8.5 * e * e, fmt::join(sessions, ", "));
}

/// What the loops' start leaves in a record looks like noise to fits and monitors.
std::string settling_note(const Scenario& scenario) {
  constexpr double num_decays = 7.0;  // e⁻⁷ is a thousandth.
  const double decay_s = slowest_decay_s(scenario), least_s = std::ceil(num_decays * decay_s);
  if (scenario.simulation.settling_s >= least_s) return {};
  const std::string_view effect =
      "records begin before the loops have settled, which standard errors may take for noise: "
      "their slowest mode";
  const std::string_view cause = scenario.controllers.empty()
                                     ? "raise the integral_hz of the loop, or set it to 0"
                                     : "a [[controller]] holds what it steers too weakly";
  if (decay_s > 1e6) return fmt::format("{} hardly decays: {}", effect, cause);
  const std::string advice =
      least_s > SimulationConfig::settling_max_s
          ? fmt::format("no simulation.settling_s is long enough: {}", cause)
          : fmt::format(
                "simulation.settling_s = {} is less than the {:.0f} s after which a "
                "thousandth of it is left",
                scenario.simulation.settling_s, least_s);
  return fmt::format("{} decays by e in {:.0f} s, and {}", effect, decay_s, advice);
}

/// What a resonator takes from a line comes in with time.
std::string resonator_note(const Scenario& scenario) {
  constexpr double part_max = 0.1;
  const double damping = scenario.drag_free.resonator_damping;
  double largest = part_max, decay_s = 0.0;
  for (const Session& session : scenario.sessions) {
    if (damping == 0.0 || !is_test(session)) continue;
    const double period_s = scenario.orbit.period_s, duration_s = session.num_orbits * period_s;
    const double of_session_s =
        1.0 / (2.0 * std::numbers::pi * damping * test_frequency_hz(session, period_s));
    const double part = exponential(-scenario.simulation.settling_s / of_session_s) *
                        (1.0 - exponential(-duration_s / of_session_s)) * of_session_s / duration_s;
    if (part > largest) std::tie(largest, decay_s) = std::pair(part, of_session_s);
  }
  if (largest == part_max) return {};
  return fmt::format(
      "with drag_free.resonator_damping = {} what the loop leaves at f_EP decays by e in {:.0f} s, "
      "so that {:.0f} % of it is left in the mean of a test: raise it, or simulation.settling_s",
      damping, decay_s, 100.0 * largest);
}

/// A file has the accelerations in the satellite's frame, and so those of one spin.
std::string environment_note(const MicroscopeCampaign& campaign) {
  const Scenario& scenario = campaign.scenario;
  if (campaign.environment_table.empty()) return {};
  const auto [slow, fast] = std::ranges::minmax(scenario.sessions, {},
                                                [](const Session& s) { return s.spin_rate_rad_s; });
  if (slow.spin_rate_rad_s != fast.spin_rate_rad_s) {
    return fmt::format(
        "environment.file has accelerations in the satellite's frame, and the satellite spins "
        "otherwise in {} than in {}: it is right for one of them at most",
        slow.name, fast.name);
  }
  const int num_orbits = std::ranges::max(scenario.sessions, {}, &Session::num_orbits).num_orbits;
  const double end_s = campaign.environment_table.back().time_s;
  const double turns = slow.spin_rate_rad_s * scenario.orbit.period_s / (2.0 * std::numbers::pi);
  if (end_s >= num_orbits * scenario.orbit.period_s) return {};
  if (std::abs(turns - std::round(turns)) < 1e-6) return {};
  return fmt::format(
      "environment.file ends after {:.0f} s, and then its first orbit is repeated, in which the "
      "satellite makes {:.6g} turns: not a whole number, so that accelerations jump; make the file "
      "as long as the longest session",
      end_s, turns);
}

std::string gaps_note(const Scenario& scenario) {
  const GapsConfig& gaps = scenario.gaps;
  if (!scenario.has_tests() || !gaps.lose_data()) return {};
  double num_orbits = 0.0, num_lost = 0.0;
  for (const Session& session : scenario.sessions) {
    if (!is_test(session)) continue;
    num_orbits += session.num_orbits;
    num_lost += session.num_orbits * (1.0 - kept_part(gaps, session, scenario.orbit.period_s));
  }
  return fmt::format("[gaps] takes about {:.2g} % of the samples of tests",
                     100.0 * num_lost / num_orbits);
}

}  // namespace

std::string MicroscopeCampaign::note() const {
  std::string all;
  for (const std::string& note :
       {unwatched_note(scenario), loops_note(scenario), settling_note(scenario),
        resonator_note(scenario), drift_note(scenario), eccentricity_note(scenario),
        environment_note(*this), gaps_note(scenario)}) {
    if (!all.empty() && !note.empty()) all += "; ";
    all += note;
  }
  return all;
}

std::vector<double> MicroscopeCampaign::objectives() const {
  std::vector<double> objectives(scenario.objectives.begin(), scenario.objectives.end());
  if (scenario.has_tests()) {
    objectives.insert(objectives.end(), scenario.test_objectives.begin(),
                      scenario.test_objectives.end());
  }
  return objectives;
}

RunDraw MicroscopeCampaign::draw(RunIndex run) const {
  PROOFMASS_EXPECT(run.value < num_runs);
  const std::vector<double> of_table = table_values(run);
  const AcceptedDraw accepted = draw_instrument(*this, run, of_table);
  RunDraw draw{.num_draws = accepted.num_draws};
  if (!accepted.instrument) return draw;
  const ParameterArray truth =
      true_parameters(*accepted.instrument, common_offset_x(scenario, *accepted.instrument));
  draw.values.assign(accepted.values.begin(), accepted.values.end());
  draw.truth = run_truth(scenario, truth, accepted.instrument->eotvos_parameter);
  return draw;
}

std::optional<ErrorBudget> MicroscopeCampaign::error_budget() const {
  return microscope_budget(scenario, dispersions, table_columns);
}

namespace {

/// If χ² of a run's fit is beyond what chance explains, every standard error that, in proportion to
/// √χ², is worth a warning, or else the largest one.
void warn_of_fit(const RunResult& result, const ParameterArray& objectives,
                 std::vector<Warning>& warnings) {
  if (result.fit.size() < 2 || result.standard_error.size() < num_parameters) return;
  const double chi_squared = result.fit[0], freedom = result.fit[1];
  if (!is_beyond_chance(chi_squared, freedom)) return;
  const double growth = std::sqrt(chi_squared / std::max(freedom, 1.0));
  std::vector<Warning> of_fit;
  for (std::size_t i = 0; i < num_parameters; ++i) {
    of_fit.push_back({"fit", i, growth * result.standard_error[i] / objectives[i]});
  }
  const auto largest = *std::ranges::max_element(of_fit, {}, &Warning::part);
  std::erase_if(of_fit, [](const Warning& warning) { return warning.part < warned_part; });
  if (of_fit.empty()) of_fit.push_back(largest);
  warnings.insert(warnings.end(), of_fit.begin(), of_fit.end());
}

}  // namespace

Warner MicroscopeCampaign::warner() const {
  // Results of older models lack what the loop left in tests.
  const std::size_t test_residual = scenario.has_tests() ? budget_level(scenario) : SIZE_MAX;
  return [bounds = ShiftBounds(scenario, dispersions), objectives = scenario.objectives,
          test_residual](const RunResult& result) {
    std::vector<Warning> warnings;
    if (result.health.empty()) return warnings;
    const auto warn = [&](Effect effect, std::size_t quantity, double part) {
      if (part >= warned_part) warnings.push_back({name_of(effect), quantity, part});
    };
    // A test alone has standard errors where the calibration has none.
    std::span<const double> errors = result.standard_error;
    if (errors.size() < num_parameters) errors = {};
    std::array<double, num_effects> of_test{};
    for (const Shift& shift : bounds.of(health_of(result.health), result.truth, errors)) {
      warn(shift.effect, index(shift.parameter), shift.part);
      if (test_residual >= result.health.size()) continue;
      of_test[static_cast<std::size_t>(shift.effect)] +=
          bounds.part_of_test(shift, result.health[test_residual]);
    }
    for (std::size_t i = 0; i < num_effects; ++i) {
      warn(static_cast<Effect>(i), num_parameters + index(TestParameter::eotvos_parameter),
           of_test[i]);
    }
    warn_of_fit(result, objectives, warnings);
    return warnings;
  };
}

namespace {

std::array<DrawnQuantity, num_drawn> make_drawn() {
  std::array<DrawnQuantity, num_drawn> drawn;
  for (std::size_t i = 0; i < num_drawn; ++i) drawn[i] = {drawn_names()[i], drawn_unit(i)};
  return drawn;
}

class MicroscopeModel final : public Model {
 public:
  [[nodiscard]] std::string_view version() const override { return model_version; }

  [[nodiscard]] std::string_view purpose() const override {
    return "Validates the in-flight calibration of drag-free accelerometers.";
  }

  [[nodiscard]] ResultSchema results_of(std::string_view definition,
                                        std::string_view version) const override {
    return scenario_results(recorded_scenario(definition), version);
  }

  [[nodiscard]] std::span<const DataTableSchema> tables() const override {
    static const std::array<DataTableSchema, 1> tables{environment_table_schema()};
    return tables;
  }

  [[nodiscard]] std::span<const DrawnQuantity> drawn() const override {
    static const std::array<DrawnQuantity, num_drawn> drawn = make_drawn();
    return drawn;
  }

  [[nodiscard]] std::string_view step_name() const override { return "orbits"; }

  [[nodiscard]] std::size_t batch_size() const override { return batch_lanes; }

  [[nodiscard]] std::uint64_t reference_digest(InstructionSet set) const override {
    return proofmass::reference_digest(set);
  }
  [[nodiscard]] std::optional<DeviceProof> prove(Device& device) const override {
    return prove_device(device);
  }

  [[nodiscard]] std::unique_ptr<Campaign> campaign_of(Definition definition, TableColumns columns,
                                                      std::string_view source) const override {
    return std::make_unique<MicroscopeCampaign>(
        proofmass::campaign_of(std::move(definition), columns, source));
  }

  [[nodiscard]] std::unique_ptr<Campaign> read_campaign(Document& document,
                                                        DataFiles& files) const override {
    return std::make_unique<MicroscopeCampaign>(proofmass::read_campaign(document, files));
  }

  [[nodiscard]] std::unique_ptr<PlanStudy> study(const Campaign& campaign) const override {
    return study_plan(microscope_of(campaign));
  }

  [[nodiscard]] bool can_study(const Campaign& campaign) const override {
    return can_study_plan(microscope_of(campaign));
  }

  [[nodiscard]] EnvironmentFile environment_file(Document& campaign, Document& physics,
                                                 const std::string& session) const override {
    auto [table, note] = made_environment(campaign, physics, session);
    return {csv_text(table), std::move(note)};
  }

  [[nodiscard]] std::string example() const override {
    return commented_campaign(hardy2013_campaign());
  }

  [[nodiscard]] std::string_view example_file() const override { return "hardy2013.toml"; }

 private:
  static const MicroscopeCampaign& microscope_of(const Campaign& campaign) {
    const auto* const own = dynamic_cast<const MicroscopeCampaign*>(&campaign);
    PROOFMASS_EXPECT(own != nullptr);
    return *own;
  }
};

}  // namespace

const Model& microscope_model() {
  static const MicroscopeModel microscope;
  return microscope;
}

}  // namespace proofmass
