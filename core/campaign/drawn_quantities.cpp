#include "core/campaign/drawn_quantities.hpp"

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "core/campaign/draw.hpp"
#include "core/error.hpp"

namespace proofmass {

std::optional<DrawnValues> accepted_values(const Campaign& campaign, RunIndex run) {
  PROOFMASS_EXPECT(run.value < campaign.num_runs);
  const std::vector<double> table_values = campaign.table_values(run);
  const AcceptedDraw draw = draw_instrument(campaign, run, table_values);
  if (!draw.instrument) return std::nullopt;
  return draw_values(campaign.dispersions, campaign.seed, run, draw.num_draws - 1, table_values);
}

std::string_view drawn_unit(std::size_t quantity) {
  // A name ends in its unit; `_s2_m` ends in `_m` too, so that the longer come first.
  static constexpr std::array<std::pair<std::string_view, std::string_view>, 5> units{
      {{"_rad_s2", "rad/s²"}, {"_m_s2", "m/s²"}, {"_s2_m", "s²/m"}, {"_rad", "rad"}, {"_m", "m"}}};
  const std::string_view name = drawn_names()[quantity];
  const std::string_view group = name.substr(0, name.find('.'));
  const auto found =
      std::ranges::find_if(units, [&](const auto& unit) { return group.ends_with(unit.first); });
  return found == units.end() ? "1" : found->second;
}

}  // namespace proofmass
