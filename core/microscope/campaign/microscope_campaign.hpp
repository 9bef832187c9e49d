#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "core/campaign/campaign.hpp"
#include "core/campaign/dispersion.hpp"
#include "core/microscope/campaign/scenario.hpp"
#include "core/microscope/environment/environment_table.hpp"
#include "core/microscope/instrument/drawn_quantities.hpp"
#include "core/microscope/instrument/instrument.hpp"

namespace proofmass {

/// A campaign of MICROSCOPE, which calibrates and may test the equivalence principle: the scenario
/// that all runs share, and the laws by which the instrument of each run is drawn.
/// `microscope_model.cpp` and `definition` define what derives from other modules.
class MicroscopeCampaign final : public Campaign {
 public:
  MicroscopeCampaign() { name = "hardy2013"; }

  Scenario scenario;
  DispersionSet dispersions = nominal_dispersions();
  std::string environment_file;        ///< As written in the campaign file; empty if harmonic.
  EnvironmentTable environment_table;  ///< Rows of that file; empty if harmonic.

  [[nodiscard]] const Model& model() const override;
  void validate(TableColumns columns = TableColumns::included) const override;

  [[nodiscard]] std::unique_ptr<Campaign> clone() const override;
  [[nodiscard]] std::unique_ptr<const Plan> prepare() const override;
  [[nodiscard]] Definition definition(TableColumns columns) const override;
  [[nodiscard]] std::vector<DefinitionItem> items() const override;
  [[nodiscard]] std::vector<DefinitionDifference> differences_from(
      const Campaign& other) const override;
  [[nodiscard]] ResultSchema results() const override;
  [[nodiscard]] std::vector<double> objectives() const override;
  [[nodiscard]] std::int64_t num_rounds_max() const override {
    return scenario.estimation.num_rounds_max;
  }
  [[nodiscard]] std::vector<std::size_t> table_quantities() const override {
    return table_elements(dispersions);
  }
  [[nodiscard]] RunDraw draw(RunIndex run) const override;
  [[nodiscard]] Interpretation interpretation() const override;
  [[nodiscard]] std::string note() const override;
  [[nodiscard]] std::optional<ErrorBudget> error_budget() const override;
  [[nodiscard]] Warner warner() const override;
};

/// The campaign of [Hardy2013] section 5: 100 draws, the corrections of the paper.
[[nodiscard]] MicroscopeCampaign hardy2013_campaign();

/// Constant of Γ_App,cx that the loop leaves in the sessions that find a_d11', m/s², as
/// true_parameters() wants it: the error of the bias that it subtracts and, where it nulls one
/// sensor, b_1d with the sign of that sensor.
[[nodiscard]] double common_offset_x(const Scenario& scenario, const Instrument& instrument);

/// The instrument of a run.
struct AcceptedDraw {
  std::optional<Instrument> instrument;  ///< Empty if all num_draws_max were rejected.
  std::uint32_t num_draws = 0;           ///< At most num_draws_max.
  DrawnValues values{};                  ///< Of the instrument; of the last one rejected without.
};

/// Draws the instrument that the run has, again as a whole until it is accepted. A pure function of
/// the campaign and the arguments. It is the only place where runs become instruments.
/// @param table_values  campaign.table_values(run).
[[nodiscard]] AcceptedDraw draw_instrument(const MicroscopeCampaign& campaign, RunIndex run,
                                           std::span<const double> table_values);

}  // namespace proofmass
