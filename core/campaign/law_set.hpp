#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/campaign/campaign.hpp"
#include "core/campaign/dispersion.hpp"
#include "core/campaign/sampling_design.hpp"
#include "core/runs.hpp"

namespace proofmass {

/// The quantities that a model draws for each run, with their laws, which may refer to one another.
struct LawSet {
  std::span<const std::string> names;  ///< Of the random streams: they must never change.
  std::span<const Dispersion> laws;    ///< Of each of `names`.
  std::string_view table;              ///< That laws are in, in a campaign file: `dispersion`.

  /// `dispersion.offcentring_m.x`, for messages.
  [[nodiscard]] std::string path_of(std::size_t quantity) const;
  /// Index of a quantity; the number of all if there is none of this name.
  [[nodiscard]] std::size_t index_of(std::string_view name) const;
};

/// Indices of the quantities with law `table`, ascending.
[[nodiscard]] std::vector<std::size_t> table_elements(std::span<const Dispersion> laws);

/// Checks that the campaign has a column for each `table` quantity, with a finite value for each
/// run. Without laws it has none.
/// @throws ConfigError naming the quantity and the rule.
void check_table_columns(const LawSet& set, const Campaign& campaign);

/// The values of a run's draw number `draw` (from 0), before any acceptance rule: a pure function
/// of its arguments. Draw 0 is in the strata of the design, whose dimension of a quantity is its
/// index; later ones are independent of other runs.
///
/// @param table_values  The run's values of the `table` quantities, in the order of
///                      table_elements().
/// @param values        Is set; one for each quantity.
void draw_values(const LawSet& set, std::uint64_t seed, RunIndex run, std::uint32_t draw,
                 std::span<const double> table_values, const SamplingDesign& design,
                 std::span<double> values);

/// Checks each law, and what the laws say of one another: names in expressions and correlations,
/// cycles, and that the correlations make a positive definite matrix.
/// @throws ConfigError naming `dispersion.<quantity>.<key>`.
void check_laws(const LawSet& set);

/// Checks that the campaign's design can draw these laws.
/// @throws ConfigError naming `campaign.design` or `campaign.points`.
void check_design(const LawSet& set, const Campaign& campaign);

/// Checks that the tables which are declared independent look like it.
/// @pre The campaign has its table_columns.
/// @throws ConfigError naming `dispersion.<quantity>.independent`.
void check_independence(const LawSet& set, const Campaign& campaign);

/// A campaign, with its laws.
struct DrawnCampaign {
  const Campaign& campaign;
  LawSet set;
};

/// The first value of a quantity, which is of a table in two campaigns, that they do not share
/// among the runs of both: `dispersion.gain of run 3`.
[[nodiscard]] std::optional<DefinitionDifference> table_difference(const DrawnCampaign& first,
                                                                   const DrawnCampaign& second,
                                                                   std::size_t quantity);

}  // namespace proofmass
