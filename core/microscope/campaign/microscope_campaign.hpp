#pragma once

#include <string>

#include "core/campaign/campaign.hpp"
#include "core/campaign/dispersion.hpp"
#include "core/microscope/campaign/drawn_quantities.hpp"
#include "core/microscope/campaign/scenario.hpp"
#include "core/microscope/environment/environment_table.hpp"

namespace proofmass {

/// A calibration campaign of MICROSCOPE.
class MicroscopeCampaign final : public Campaign {
 public:
  MicroscopeCampaign() { name = "hardy2013"; }

  Scenario scenario;
  DispersionSet dispersions = nominal_dispersions();
  std::string environment_file;        ///< As written in the campaign file; empty if harmonic.
  EnvironmentTable environment_table;  ///< Rows of that file; empty if harmonic.

  void validate() const override;
  /// The same but for `table_columns`, which may be absent.
  /// @throws ConfigError naming the field, its value and the rule.
  void validate_without_columns() const;

  [[nodiscard]] std::unique_ptr<Campaign> clone() const override;
  [[nodiscard]] std::unique_ptr<const Plan> prepare() const override;
  [[nodiscard]] Definition definition(TableColumns columns) const override;
  [[nodiscard]] std::vector<DefinitionItem> items() const override;
  [[nodiscard]] std::vector<DefinitionDifference> differences_from(
      const Campaign& other) const override;
  [[nodiscard]] std::vector<double> objectives() const override;
  [[nodiscard]] std::int64_t num_rounds_max() const override;
  [[nodiscard]] std::vector<std::size_t> table_quantities() const override;
  [[nodiscard]] RunDraw draw(RunIndex run) const override;
  [[nodiscard]] std::optional<ErrorBudget> error_budget() const override;
};

/// The campaign of [Hardy2013] section 5: 100 draws, the corrections of the paper.
[[nodiscard]] MicroscopeCampaign hardy2013_campaign();

}  // namespace proofmass
