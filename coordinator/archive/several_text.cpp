#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "coordinator/archive/detail/comparison_json.hpp"
#include "coordinator/archive/several_comparison.hpp"
#include "coordinator/report/text_cells.hpp"
#include "core/model.hpp"
#include "core/statistics/comparison.hpp"

namespace proofmass::coordinator {
namespace {

constexpr std::size_t several_width = 80;

constexpr std::string_view of_errors = "|error|";
constexpr std::string_view of_changes = "p of a change";

/// `beyond` stands before the line as in the tables of a report.
std::array<TextColumn, 11> member_columns(std::string_view title) {
  return {{{title, 16, true},
           {"worst", 8, false, of_errors},
           {"mean", 8, false, of_errors},
           {"std", 8, false, of_errors},
           {"beyond", 8, false, of_errors},
           {"bias", 8, false, of_changes, true},
           {"", 2, true, of_changes},
           {"scatter", 8, false, of_changes},
           {"", 2, true, of_changes},
           {"tail", 8, false, of_changes},
           {"", 2, true, of_changes}}};
}

/// What some of the campaigns have in common, and which ones they are.
using Shared = std::pair<std::string, std::vector<std::string>>;

void share(std::vector<Shared>& all, const std::string& text, const std::string& name) {
  const auto same = std::ranges::find(all, text, &Shared::first);
  if (same == all.end()) {
    all.emplace_back(text, std::vector{name});
  } else {
    same->second.push_back(name);
  }
}

/// `head` and words behind it, on as many lines as they take; further ones have the indent.
std::string with_words(std::string line, const std::vector<std::string>& words,
                       std::size_t indent) {
  std::string text;
  for (const std::string& word : words) {
    if (display_width(line) + 1 + display_width(word) > several_width) {
      text += line + "\n";
      line = std::string(indent, ' ');
    }
    line += " " + word;
  }
  return text + line + "\n";
}

std::string campaign_list(std::span<const ComparedMember> members, const MemberNames& names) {
  std::size_t width = 0;
  for (const std::string& name : names.names) width = std::max(width, display_width(name));
  std::string text;
  for (std::size_t i = 0; i < members.size(); ++i) {
    const std::uint64_t num_runs = members[i].statistics.num_estimated;
    text += fmt::format("{}  {}{}, {} {}\n", left_aligned(names.names[i], width), names.notes[i],
                        members[i].file.string(), num_runs, num_runs == 1 ? "run" : "runs");
  }
  return text;
}

/// Keys of the definitions in which not all campaigns agree, and the campaigns with each value.
std::vector<std::pair<std::string, std::vector<Shared>>> differing_keys(
    std::span<const ComparedMember> members, const MemberNames& names) {
  std::vector<std::pair<std::string, std::vector<Shared>>> keys;
  const auto values_of = [&](const DefinitionDifference& difference) -> std::vector<Shared>& {
    for (auto& [key, values] : keys) {
      if (key == difference.field) return values;
    }
    return keys.emplace_back(difference.field, std::vector<Shared>()).second;
  };
  for (const ComparedMember& member : members.subspan(1)) {
    for (const auto& difference : member.comparison->differences) (void)values_of(difference);
  }
  for (auto& [key, values] : keys) {
    std::string of_first;
    for (const ComparedMember& member : members.subspan(1)) {
      for (const auto& difference : member.comparison->differences) {
        if (difference.field == key) of_first = difference.first;
      }
    }
    share(values, of_first, names.names.front());
    for (std::size_t i = 1; i < members.size(); ++i) {
      const auto& differences = members[i].comparison->differences;
      const auto own = std::ranges::find(differences, key, &DefinitionDifference::field);
      share(values, own == differences.end() ? of_first : own->second, names.names[i]);
    }
  }
  return keys;
}

std::string several_definitions(std::span<const ComparedMember> members, const MemberNames& names) {
  const auto keys = differing_keys(members, names);
  if (keys.empty()) return "The definitions agree.\n";
  std::string text = "The definitions differ:\n";
  for (const auto& [key, values] : keys) {
    std::string line = fmt::format("  {}:", key);
    std::string_view separator = "";
    for (const auto& [value, of] : values) {
      line += fmt::format("{} {} in {}", separator, value, fmt::join(of, " "));
      separator = ",";
    }
    if (display_width(line) <= several_width) {
      text += line + "\n";
      continue;
    }
    text += fmt::format("  {}\n", key);
    for (const auto& [value, of] : values) {
      constexpr std::size_t indent = 8;
      text += with_words(fmt::format("    {}  in", value), of, indent);
    }
  }
  return text;
}

std::string how_compared(const CampaignComparison& comparison) {
  if (!comparison.why_not_compared.empty()) {
    return fmt::format("cannot be compared, {}", comparison.why_not_compared);
  }
  if (!comparison.is_paired()) return fmt::format("as a whole, as {}", comparison.why_unpaired);
  return fmt::format("run by run, {} {} of the same draws", comparison.num_first,
                     comparison.num_first == 1 ? "run" : "runs");
}

std::string several_basis(std::span<const ComparedMember> members, const MemberNames& names) {
  std::vector<Shared> ways;
  for (std::size_t i = 1; i < members.size(); ++i) {
    share(ways, how_compared(*members[i].comparison), names.names[i]);
  }
  constexpr std::size_t indent = 4;
  std::string text = fmt::format("Compared with {}:\n", names.names.front());
  for (const auto& [way, of] : ways) text += with_words(fmt::format("  {}:", way), of, indent);
  for (std::size_t i = 0; i < members.size(); ++i) {
    if (members[i].missing.total() == 0) continue;
    text += fmt::format("Left out of {}, without an estimate: {}.\n", names.names[i],
                        reasons_text(members[i].missing));
  }
  return text;
}

std::string several_row(std::span<const TextColumn> columns, const std::string& name,
                        const ComparedMember& member, std::size_t i) {
  const Quantity& quantity = model().results().quantities[i];
  const double scale = quantity.display_scale;
  const std::uint64_t num_runs = member.statistics.num_estimated;
  std::vector<std::string> cells{name};
  if (num_runs == 0) {
    cells.insert(cells.end(), 4, "-");
  } else {
    const AccuracyStatistic& accuracy = member.statistics.accuracy[i];
    cells.push_back(measured_figure(accuracy.worst / scale));
    cells.push_back(measured_figure(accuracy.mean / scale));
    cells.push_back(num_runs < 2 ? "-" : measured_figure(accuracy.standard_deviation / scale));
    cells.push_back(
        std::isfinite(member.objectives[i]) ? std::to_string(accuracy.num_beyond_objective) : "-");
  }
  const bool has_changes = member.comparison && member.comparison->why_not_compared.empty();
  if (!has_changes) {
    cells.resize(columns.size());
    return table_row(columns, cells, WideCell::keep);
  }
  const ChangePValues& p = member.comparison->parameters[i].adjusted_p_values;
  for (const double p_value : {p.location, p.scale, p.tail}) {
    cells.push_back(measured_figure(p_value));
    cells.emplace_back(p_value < 1.0 - default_confidence ? " *" : "");
  }
  return table_row(columns, cells, WideCell::keep);
}

std::string objective_text(std::span<const ComparedMember> members, std::size_t i) {
  const double objective = members.front().objectives[i];
  const auto has_same = [&](const ComparedMember& member) {
    return member.objectives[i] == objective;  // Copied, not computed.
  };
  if (!std::ranges::all_of(members, has_same)) return ", objectives differ";
  if (!std::isfinite(objective)) return "";
  const Quantity& quantity = model().results().quantities[i];
  return fmt::format(", objective {}", given_figure(objective / quantity.display_scale));
}

std::string parameter_table(std::span<const ComparedMember> members, const MemberNames& names,
                            std::size_t i) {
  const auto columns = member_columns(names.title);
  const Quantity& quantity = model().results().quantities[i];
  std::string text = fmt::format("\n{}, {}{}\n\n{}", quantity.symbol, quantity.display_unit,
                                 objective_text(members, i), table_heading(columns));
  for (std::size_t member = 0; member < members.size(); ++member) {
    text += several_row(columns, names.names[member], members[member], i);
  }
  return text;
}

using Json = nlohmann::ordered_json;

Json accuracy_json(const ComparedMember& member, std::size_t i) {
  const Quantity& quantity = model().results().quantities[i];
  Json json{{"parameter", quantity.name},
            {"unit", quantity.unit},
            {"objective", nullptr},
            {"worst", nullptr},
            {"mean", nullptr},
            {"standard_deviation", nullptr},
            {"num_beyond_objective", nullptr}};
  if (std::isfinite(member.objectives[i])) json["objective"] = member.objectives[i];
  if (member.statistics.num_estimated == 0) return json;
  const AccuracyStatistic& accuracy = member.statistics.accuracy[i];
  json["worst"] = accuracy.worst;
  json["mean"] = accuracy.mean;
  if (member.statistics.num_estimated > 1) {
    json["standard_deviation"] = accuracy.standard_deviation;
  }
  json["num_beyond_objective"] = accuracy.num_beyond_objective;
  return json;
}

Json member_json(const ComparedMember& member, const std::string& first) {
  Json json{{"file", member.file.string()},
            {"num_runs", member.num_runs},
            {"num_finished", member.statistics.num_runs},
            {"num_with_estimate", member.statistics.num_estimated},
            {"num_without_estimate", member.missing.total()},
            {"digest", member.digest},
            {"parameters", Json::array()},
            {"comparison", nullptr}};
  for (std::size_t i = 0; i < member.objectives.size(); ++i) {
    json["parameters"].push_back(accuracy_json(member, i));
  }
  if (member.comparison) {
    json["comparison"] = detail::comparison_object(*member.comparison, first, member.file.string());
  }
  return json;
}

}  // namespace

MemberNames lettered(std::size_t count) {
  constexpr std::size_t num_letters = 26;
  MemberNames names{.title = "campaign", .names = {}, .notes = std::vector<std::string>(count)};
  for (std::size_t i = 0; i < count; ++i) {
    std::string name;
    for (std::size_t rest = i + 1; rest > 0; rest = (rest - 1) / num_letters) {
      name.insert(name.begin(), static_cast<char>('A' + (rest - 1) % num_letters));
    }
    names.names.push_back(name);
  }
  return names;
}

std::string several_text(std::span<const ComparedMember> members, const MemberNames& names) {
  std::string text = campaign_list(members, names) + "\n" + several_definitions(members, names) +
                     several_basis(members, names);
  const std::size_t num_quantities = model().results().quantities.size();
  for (std::size_t i = 0; i < num_quantities; ++i) text += parameter_table(members, names, i);
  return text +
         fmt::format(
             "beyond: runs whose error exceeds the objective; p: that chance alone makes such\n"
             "a difference from {}, adjusted for three tests of all parameters of all\n"
             "campaigns (Holm); *: below {:.2f}. `proofmass compare` of two has more.\n",
             names.names.front(), 1.0 - default_confidence);
}

std::string several_json(std::span<const ComparedMember> members,
                         std::span<const std::vector<KeyText>> varied) {
  const std::string first = members.front().file.string();
  Json json{{"confidence", default_confidence}, {"campaigns", Json::array()}};
  for (std::size_t i = 0; i < members.size(); ++i) {
    Json member = member_json(members[i], first);
    if (!varied.empty()) {
      Json values = Json::object();
      for (const auto& [key, value] : varied[i]) values[key] = value;
      member["varied"] = values;
    }
    json["campaigns"].push_back(std::move(member));
  }
  constexpr int indent = 2;
  return json.dump(indent, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace proofmass::coordinator
