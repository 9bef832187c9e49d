#include "core/definition/entry.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>
#include <variant>

#include "core/campaign/dispersion.hpp"
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

std::vector<DefinitionItem> items_of(std::vector<Entry> entries) {
  std::vector<DefinitionItem> items;
  for (auto& [path, text, comment, value] : entries) {
    items.push_back({std::move(path), std::move(value)});
  }
  return items;
}

std::string text_of(const std::vector<Entry>& entries, std::string_view between_tables,
                    Comments comments) {
  std::string text, table;
  for (const Entry& entry : entries) {
    const std::size_t dot = entry.path.rfind('.');
    const std::string of = entry.path.substr(0, dot);
    if (std::exchange(table, of) != of) {
      text += fmt::format("{}[{}]\n", text.empty() ? "" : between_tables, of);
    }
    text += fmt::format("{} = {}", entry.path.substr(dot + 1), entry.text);
    if (comments == Comments::included && !entry.comment.empty()) text += "  # " + entry.comment;
    text += '\n';
  }
  return text;
}

std::vector<DefinitionDifference> differences_between(const std::vector<Entry>& first,
                                                      const std::vector<Entry>& second) {
  std::vector<DefinitionDifference> differences;
  const auto differ = [&](std::string path, const std::string& text, const std::string& other) {
    if (path == "campaign.runs" || text == other) return;
    constexpr std::string_view table = "campaign.";
    if (path.starts_with(table)) path.erase(0, table.size());
    differences.push_back({std::move(path), text, other});
  };
  const auto is_source = [](std::string_view path) {
    return path.starts_with("drawn.") && (path.ends_with(".file") || path.ends_with(".column"));
  };
  for (const Entry& entry : first) {
    const auto same = std::ranges::find(second, entry.path, &Entry::path);
    if (same == second.end()) {
      differ(entry.path, entry.text, "none");
    } else if (!is_source(entry.path)) {
      differ(entry.path, entry.text, same->text);
    }
  }
  for (const Entry& entry : second) {
    const auto same = std::ranges::find(first, entry.path, &Entry::path);
    if (same == first.end()) differ(entry.path, "none", entry.text);
  }
  return differences;
}

namespace {

Entry law_entry(std::string_view key, double value) { return real_entry(key, value); }
Entry law_entry(std::string_view key, const std::string& text) { return text_entry(key, text); }
Entry law_entry(std::string_view key, const std::vector<double>& values) {
  return list_entry(key, values, number_text);
}
Entry law_entry(std::string_view key, const std::vector<std::string>& texts) {
  return list_entry(key, texts, quoted_text);
}

}  // namespace

std::vector<Entry> law_entries(const Dispersion& law) {
  Dispersion fields = law;
  std::vector<Entry> entries{choice_entry("law", law.law)};
  for (const std::string_view key : keys_of(law.law)) {
    entries.push_back(std::visit([key](const auto* field) { return law_entry(key, *field); },
                                 field_of(fields, key)));
  }
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
  if (campaign.realisations != 1) {
    entries.push_back(whole_entry("campaign.realisations", whole(campaign.realisations),
                                  "Runs that share one instrument and differ in their noise."));
  }
  const SamplingDesign design = campaign.design;
  if (design.kind != DesignKind::random) {
    entries.push_back(choice_entry("campaign.design", design.kind,
                                   "\"random\", \"latin_hypercube\" or \"sobol\"."));
    entries.push_back(
        whole_entry("campaign.points", whole(design.points), "Runs of a replicate of the design."));
  }
  return entries;
}

}  // namespace proofmass::detail
