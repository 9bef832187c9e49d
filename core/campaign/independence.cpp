#include "core/campaign/independence.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>
#include <variant>
#include <vector>

#include "core/campaign/dispersion.hpp"
#include "core/error.hpp"

namespace proofmass {

std::string why_not_independent(const Campaign& campaign) {
  if (const std::uint64_t realisations = campaign.realisations; realisations > 1) {
    return fmt::format("{} runs each share one draw (campaign.realisations)", realisations);
  }
  if (const SamplingDesign design = campaign.design; design.points > 1) {
    return fmt::format("{} runs each are one replicate of a design (campaign.design = \"{}\")",
                       design.points, name_of(design.kind));
  }
  constexpr std::string_view law_key = ".law";
  const std::vector<DefinitionItem> items = campaign.items();
  for (const DefinitionItem& item : items) {
    const auto* const law = std::get_if<std::string>(&item.value);
    if (law == nullptr || *law != "table" || !item.key.ends_with(law_key)) continue;
    const std::string path = item.key.substr(0, item.key.size() - law_key.size());
    const std::string declaration = path + ".independent";
    if (std::ranges::find(items, declaration, &DefinitionItem::key) != items.end()) continue;
    return fmt::format(
        "{} is a table that is not declared independent (campaign.independent = true in the schema "
        "of an import, {} = true in other files), so that the draws may be those of a design",
        path, declaration);
  }
  return "";
}

void require_independent(const Campaign& campaign, const std::string& field,
                         const std::string& value) {
  const std::string why = why_not_independent(campaign);
  if (!why.empty()) throw ConfigError(field, value, "needs independent draws: " + why);
}

}  // namespace proofmass
