#include "core/definition/entry.hpp"

#include <fmt/format.h>

#include "core/campaign/law_keys.hpp"
#include "core/definition/definition_text.hpp"

namespace proofmass::detail {

Entry text_entry(std::string_view path, std::string_view text, std::string comment) {
  return {std::string(path), quoted_text(text), std::move(comment), std::string(text)};
}

Entry real_entry(std::string_view path, double value, std::string comment) {
  return {std::string(path), number_text(value), std::move(comment), value};
}

Entry whole_entry(std::string_view path, std::int64_t value, std::string comment) {
  return {std::string(path), fmt::format("{}", value), std::move(comment), value};
}

namespace {

Entry law_entry(std::string_view key, Dispersion& law) {
  if (const double* const number = number_at(law, key)) return real_entry(key, *number);
  if (const auto* const numbers = numbers_at(law, key)) {
    return list_entry(key, *numbers, number_text);
  }
  if (const auto* const texts = texts_at(law, key)) return list_entry(key, *texts, quoted_text);
  return text_entry(key, *text_at(law, key));
}

}  // namespace

std::vector<Entry> law_entries(const Dispersion& law) {
  Dispersion fields = law;
  std::vector<Entry> entries{choice_entry("law", law.law)};
  for (const std::string_view key : keys_of(law.law)) entries.push_back(law_entry(key, fields));
  if (law.is_independent) entries.push_back({"independent", "true", "", "true"});
  return entries;
}

std::vector<Entry> campaign_entries(const Campaign& campaign) {
  const auto whole = [](std::uint64_t count) { return static_cast<std::int64_t>(count); };
  std::vector<Entry> entries{
      text_entry("campaign.name", campaign.name, "Letters, digits, _, - or ."),
      whole_entry("campaign.seed", whole(campaign.seed), "All randomness follows from it."),
      whole_entry("campaign.runs", whole(campaign.num_runs), "May grow later."),
  };
  if (campaign.num_realisations() != 1) {
    entries.push_back(whole_entry("campaign.realisations", whole(campaign.num_realisations()),
                                  "Runs that share one instrument and differ in their noise."));
  }
  const SamplingDesign design = campaign.sampling_design();
  if (design.kind != DesignKind::random) {
    entries.push_back(choice_entry("campaign.design", design.kind,
                                   "\"random\", \"latin_hypercube\" or \"sobol\"."));
    entries.push_back(
        whole_entry("campaign.points", whole(design.points), "Runs of a replicate of the design."));
  }
  return entries;
}

}  // namespace proofmass::detail
