#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/campaign/dispersion.hpp"
#include "core/campaign/identifiers.hpp"
#include "core/campaign/scenario.hpp"
#include "core/environment/environment_table.hpp"

namespace proofmass {

/// Everything a campaign's results depend on, and how many runs there are.
struct Campaign {
  std::string name = "hardy2013";
  std::uint64_t seed = 1;
  std::uint64_t num_runs = 100;
  Scenario scenario;
  DispersionSet dispersions = nominal_dispersions();
  std::string environment_file;        ///< As written in the campaign file; empty if harmonic.
  EnvironmentTable environment_table;  ///< Rows of that file; empty if harmonic.
  /// For each of table_elements(dispersions), its value for every run; at least num_runs each.
  std::vector<std::vector<double>> table_columns;

  /// @throws ConfigError naming the field, its value and the rule.
  void validate() const;
  /// The same but for `table_columns`, which may be absent.
  /// @throws ConfigError naming the field, its value and the rule.
  void validate_without_columns() const;

  /// Values of the `table` quantities for one run, in the order of table_elements().
  [[nodiscard]] std::vector<double> table_values(RunIndex run) const;
};

/// The campaign of [Hardy2013] section 5: 100 draws, the corrections of the paper.
[[nodiscard]] Campaign hardy2013_campaign();

}  // namespace proofmass
