#include "core/microscope/microscope_model.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <memory>
#include <span>
#include <string>
#include <utility>

#include "core/error.hpp"
#include "core/microscope/campaign/budget.hpp"
#include "core/microscope/campaign/microscope_campaign.hpp"
#include "core/microscope/campaign/shift_bounds.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "core/microscope/definition/made_environment.hpp"
#include "core/microscope/estimation/methods.hpp"
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
