#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "coordinator/archive/comparison.hpp"
#include "coordinator/report/json.hpp"
#include "coordinator/table/table.hpp"
#include "core/campaign/independence.hpp"
#include "core/statistics/comparison.hpp"
#include "core/statistics/error_change.hpp"

namespace proofmass::coordinator {
namespace {

constexpr double significance = 1.0 - default_confidence;

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

/// Keys of the definitions in which not all campaigns agree, and the campaigns with each value.
std::vector<std::pair<std::string, std::vector<Shared>>> differing_keys(
    std::span<const ComparedCampaign> members, const MemberNames& names) {
  std::vector<std::pair<std::string, std::vector<Shared>>> keys;
  for (const ComparedCampaign& member : members.subspan(1)) {
    for (const auto& [field, of_first, of_other] : member.comparison->differences) {
      const bool is_new =
          std::ranges::none_of(keys, [&](const auto& key) { return key.first == field; });
      if (is_new) keys.push_back({field, {{of_first, {names.names.front()}}}});
    }
  }
  for (auto& [key, values] : keys) {
    const std::string of_first = values.front().first;
    for (std::size_t i = 1; i < members.size(); ++i) {
      const auto& differences = members[i].comparison->differences;
      const auto own = std::ranges::find(differences, key, &DefinitionDifference::field);
      share(values, own == differences.end() ? of_first : own->second, names.names[i]);
    }
  }
  return keys;
}

Table definition_table(std::span<const ComparedCampaign> members, const MemberNames& names) {
  const auto keys = differing_keys(members, names);
  if (keys.empty()) return {.remarks = {{"The definitions agree."}}};
  Table table{.columns = {{"the definitions differ in", true}, {"value", true}, {"of", true}}};
  for (const auto& [key, values] : keys) {
    for (const auto& [value, of] : values) {
      const bool is_first = &value == &values.front().first;
      table.rows.push_back({is_first ? key : "", value, fmt::format("{}", fmt::join(of, " "))});
    }
  }
  return table;
}

std::string how_compared(const ComparedCampaign& member, const ComparedCampaign& first) {
  const CampaignComparison& comparison = *member.comparison;
  if (!comparison.why_not_compared.empty()) return "not at all";
  const std::string& digest = member.results.digests.results;
  if (!digest.empty() && digest == first.results.digests.results) return "identical results";
  if (!comparison.is_paired()) return "as a whole, as " + comparison.why_unpaired;
  return fmt::format("run by run, {} {} of the same draws", comparison.num_pairs,
                     comparison.num_pairs == 1 ? "run" : "runs");
}

/// Says what becomes of the runs of a campaign with an estimate that are in no pair.
void add_unpaired(const ComparedRuns& runs, std::size_t num_pairs, std::string_view name,
                  std::string_view other, Table& table) {
  const std::size_t num_unpaired = runs.num_estimated - num_pairs;
  if (num_unpaired == 0) return;
  const std::size_t num_missing = num_unpaired - runs.num_alone;
  std::string what = "were not computed in " + std::string(other);
  if (runs.num_alone == 0) {
    what = "have no estimate in " + std::string(other);
  } else if (num_missing > 0) {
    what += fmt::format(" or, {} of them, have no estimate there", num_missing);
  }
  table.notes.push_back(fmt::format(
      "{} runs of {} {}: they count in bias, std and tail, not in change; {}", num_unpaired, name,
      what,
      runs.num_tested == 0 ? "they are in no test"
                           : fmt::format("the {} not computed are tested as a whole, and p is "
                                         "twice the smaller of both tests",
                                         runs.num_tested)));
}

/// Names the quantities that only one of two campaigns has, which are not compared.
void add_own_quantities(const ComparedCampaign& first, const ComparedCampaign& other,
                        std::string_view first_name, std::string_view other_name, Table& table) {
  const auto add = [&](const ComparedCampaign& one, std::string_view name,
                       const ComparedCampaign& two, std::string_view without) {
    std::string own;
    for (const Quantity& quantity : lacking(one.quantities, two.quantities)) {
      if (!own.empty()) own += ", ";
      own += quantity.name;
      if (quantity.unit != "1") own += fmt::format(" in {}", quantity.unit);
    }
    if (own.empty()) return;
    table.notes.push_back(
        fmt::format("not compared, as {} has them and {} has not: {}", name, without, own));
  };
  add(first, first_name, other, other_name);
  add(other, other_name, first, first_name);
}

/// `B`, or `campaign.runs=10` of a sweep, whose names alone are numbers.
std::string label(const MemberNames& names, std::size_t member) {
  const std::string& name = names.names[member];
  return names.title == lettered(0).title ? name : fmt::format("{}={}", names.title, name);
}

bool has_changes(const ComparedCampaign& member) {
  return member.comparison && member.comparison->why_not_compared.empty();
}

/// Runs that are lost more or less often than in the first campaign select others of the draws.
void add_selection(std::span<const ComparedCampaign> members, const MemberNames& names,
                   std::size_t i, Table& table) {
  if (i == 0 || !has_changes(members[i])) return;
  const MissingEstimates &first = members.front().results.missing,
                         &other = members[i].results.missing;
  const auto num_all = [&](std::size_t member) {
    const ReadResults& results = members[member].results;
    return results.statistics.num_estimated + results.missing.total();
  };
  const double p = fisher_exact_p_value({.num_first = num_all(0),
                                         .tail_first = first.total(),
                                         .num_second = num_all(i),
                                         .tail_second = other.total()});
  const auto num_others = static_cast<double>(members.size() - 1);
  if (p * num_others >= significance) return;  // By Bonferroni.
  table.remarks.push_back(
      {fmt::format("{} and {} lack estimates not equally often (p {}, Fisher's exact test): the "
                   "runs that are compared are selected, and what they show does not hold for all "
                   "draws.",
                   label(names, 0), label(names, i), measured_figure(p)),
       Tone::bad});
}

Table campaign_table(std::span<const ComparedCampaign> members, const MemberNames& names) {
  Table table{.columns = {{names.title, true},
                          {"file", true},
                          {"runs"},
                          {"compared with " + names.names.front(), true}}};
  for (std::size_t i = 0; i < members.size(); ++i) {
    const ComparedCampaign& member = members[i];
    table.rows.push_back({names.names[i], member.file.string(),
                          std::to_string(member.results.statistics.num_estimated),
                          member.comparison ? how_compared(member, members.front()) : ""});
    if (member.comparison && !member.comparison->why_not_compared.empty()) {
      const bool is_of_first = !why_not_independent(*members.front().campaign).empty();
      const std::string note =
          fmt::format("{} cannot be compared: {}", names.names[is_of_first ? 0 : i],
                      member.comparison->why_not_compared);
      if (!is_of_first || i == 1) table.notes.push_back(note);
    }
    if (member.comparison && member.comparison->num_pairs > 0) {
      const CampaignComparison& of = *member.comparison;
      const std::string first = label(names, 0), other = label(names, i);
      add_unpaired(of.first, of.num_pairs, first, other, table);
      add_unpaired(of.second, of.num_pairs, other, first, table);
    }
    add_own_quantities(members.front(), member, names.names.front(), names.names[i], table);
    if (member.results.missing.total() > 0) {
      table.remarks.push_back({fmt::format("Left out of {}, without an estimate: {}.",
                                           names.names[i], reasons_text(member.results.missing))});
    }
    if (member.num_left_out > 0) {
      table.remarks.push_back({fmt::format("Left out of {}: {} after the first that is missing.",
                                           names.names[i], counted(member.num_left_out, "run"))});
    }
    add_selection(members, names, i, table);
  }
  return table;
}

std::string figure_with_sign(double value) {
  const std::string figure = measured_figure(std::abs(value));
  if (figure == "0") return figure;
  return (value < 0.0 ? "-" : "+") + figure;
}

/// How a quantity differs from the first campaign. Null where that is not compared.
const ParameterComparison* change_in(const ComparedCampaign& member, const Quantity& quantity) {
  if (!has_changes(member)) return nullptr;
  for (const ParameterComparison& one : member.comparison->parameters) {
    if (place_of(quantity, {&one.quantity, 1}) == 0) return &one;
  }
  return nullptr;
}

/// Errors of a campaign in the runs that are compared: of the first one, with the first other that
/// can be. Null if it has none.
const ComparedAccuracy* accuracy_of(std::span<const ComparedCampaign> members, std::size_t member,
                                    const Quantity& quantity) {
  if (member > 0) {
    const ParameterComparison* const change = change_in(members[member], quantity);
    return change == nullptr ? nullptr : &change->second;
  }
  for (const ComparedCampaign& other : members) {
    if (const auto* const change = change_in(other, quantity)) return &change->first;
  }
  return nullptr;
}

/// The quantities of all campaigns, each once, those of the first one first.
std::vector<Quantity> all_quantities(std::span<const ComparedCampaign> members) {
  std::vector<Quantity> all;
  for (const ComparedCampaign& member : members) {
    for (const Quantity& quantity : member.quantities) {
      if (place_of(quantity, all) == all.size()) all.push_back(quantity);
    }
  }
  return all;
}

/// The p-value, and a mark if it is significant.
void add_p(double p_value, Row& row) {
  const bool is_significant = p_value < significance;
  row.emplace_back(measured_figure(p_value) + (is_significant ? " *" : "  "),
                   is_significant ? Tone::changed : Tone::plain);
}

std::string percent(std::size_t count, std::size_t of) {
  return fmt::format("{:.1f} %", 100.0 * static_cast<double>(count) / static_cast<double>(of));
}

/// A row for each parameter and each campaign that has it, which begins with their names.
/// @param columns      Behind those of the names.
/// @param add_cells    Called with the row, the campaign, the parameter and its place among those
///                     of the campaign; cells that it does not add are empty.
template <typename AddCells>
Table table_of(std::span<const ComparedCampaign> members, const MemberNames& names,
               std::string caption, std::vector<Column> columns, const AddCells& add_cells) {
  Table table{.caption = std::move(caption),
              .columns = {{"parameter", true, 10}, {"unit", true, 9}, {names.title, true, 9}}};
  std::ranges::move(columns, std::back_inserter(table.columns));
  for (const Quantity& quantity : all_quantities(members)) {
    bool is_first = true;
    for (std::size_t member = 0; member < members.size(); ++member) {
      const std::vector<Quantity>& own = members[member].quantities;
      const std::size_t place = place_of(quantity, own);
      if (place == own.size()) continue;
      Row& row = table.rows.emplace_back();
      row.emplace_back(is_first ? quantity.symbol : "");
      row.emplace_back(is_first ? quantity.display_unit : "");
      row.emplace_back(names.names[member]);
      add_cells(row, member, quantity, place);
      row.resize(table.columns.size(), Cell(""));
      is_first = false;
    }
  }
  return table;
}

Table bias_table(std::span<const ComparedCampaign> members, const MemberNames& names) {
  const auto add_cells = [&](Row& row, std::size_t member, const Quantity& quantity, std::size_t) {
    const double scale = quantity.display_scale;
    const ComparedAccuracy* const accuracy = accuracy_of(members, member, quantity);
    row.emplace_back(accuracy == nullptr ? "-" : figure_with_sign(accuracy->bias / scale));
    if (member == 0 || accuracy == nullptr) return;
    const ParameterComparison& change = *change_in(members[member], quantity);
    row.emplace_back(figure_with_sign(change.bias_change / scale));
    const auto& interval = change.bias_interval;
    row.emplace_back(interval ? figure_with_sign(interval->lower / scale) : "-");
    row.emplace_back(interval ? figure_with_sign(interval->upper / scale) : "-");
    add_p(change.adjusted_p_values.location, row);
  };
  Table table = table_of(members, names, "Bias: mean of estimate − truth",
                         {{"bias", false, 9},
                          {"change", false, 10},
                          {"from", false, 10},
                          {"to", false, 10},
                          {"p  ", false, 11}},
                         add_cells);
  table.notes.push_back(fmt::format(
      "from, to: 95 % interval of the change from {}; p: Student's t, as a whole the larger of "
      "it and Welch's; of fewer than {} runs the larger of t and Wilcoxon's (pairs) or Smirnov's",
      names.names.front(), num_welch_min));
  return table;
}

Table scatter_table(std::span<const ComparedCampaign> members, const MemberNames& names) {
  const auto add_cells = [&](Row& row, std::size_t member, const Quantity& quantity, std::size_t) {
    const double scale = quantity.display_scale;
    const ComparedAccuracy* const accuracy = accuracy_of(members, member, quantity);
    row.emplace_back(accuracy == nullptr ? "-"
                                         : measured_figure(accuracy->standard_deviation / scale));
    if (member == 0 || accuracy == nullptr) return;
    const CampaignComparison& comparison = *members[member].comparison;
    const ParameterComparison& change = *change_in(members[member], quantity);
    add_p(change.adjusted_p_values.scale, row);
    const auto& factor = change.smallest_scale_factor;
    row.emplace_back(factor ? measured_figure(100.0 * (*factor - 1.0)) + " %" : "-");
    row.emplace_back(percent(change.first.num_in_tail, comparison.first.num_estimated));
    row.emplace_back(percent(change.second.num_in_tail, comparison.second.num_estimated));
    add_p(change.adjusted_p_values.tail, row);
  };
  const std::string& first = names.names.front();
  Table table = table_of(
      members, names, "Scatter and tail: standard deviation of estimate − truth, and runs far off",
      {{"std", false, 8},
       {"p  ", false, 10},
       {"found", false, 8},
       {"tail " + first, false, 8},
       {"tail", false, 8},
       {"p  ", false, 10}},
      add_cells);
  table.notes = {
      fmt::format(
          "p: the tests of the bias, of distances from the mean; found: the smallest change of "
          "the scatter that this finds in {:.0f} % of such campaigns",
          100.0 * finding_probability),
      fmt::format("tail: beyond twice the root mean square of {} and the campaign, p: sign test of "
                  "pairs; as a whole Fisher's exact test",
                  first),
      fmt::format("All p are adjusted for three tests of all parameters of all campaigns (Holm), "
                  "and hold for numbers of runs that were fixed beforehand; *: below {:.2f}",
                  significance)};
  return table;
}

/// Of all runs of each campaign, which has them even if it cannot be compared.
Table magnitude_table(std::span<const ComparedCampaign> members, const MemberNames& names) {
  const auto add_cells = [&](Row& row, std::size_t member, const Quantity& quantity,
                             std::size_t i) {
    const double scale = quantity.display_scale;
    const double objective = members[member].campaign->objectives()[i];
    row.emplace_back(std::isfinite(objective) ? given_figure(objective / scale) : "-");
    const std::uint64_t num_runs = members[member].results.statistics.num_estimated;
    if (num_runs == 0) {
      row.insert(row.end(), 4, Cell("-"));
      return;
    }
    const AccuracyStatistic& accuracy = members[member].results.statistics.accuracy[i];
    row.emplace_back(measured_figure(accuracy.worst / scale));
    row.emplace_back(measured_figure(accuracy.mean / scale));
    row.emplace_back(num_runs < 2 ? "-" : measured_figure(accuracy.standard_deviation / scale));
    const std::uint64_t beyond = accuracy.num_beyond_objective;
    row.emplace_back(std::isfinite(objective) ? std::to_string(beyond) : "-",
                     beyond > 0 ? Tone::bad : Tone::plain);
  };
  Table table = table_of(members, names, "|estimate − truth| of all runs with an estimate",
                         {{"objective", false, 10},
                          {"worst", false, 9},
                          {"mean", false, 9},
                          {"std", false, 9},
                          {"beyond", false, 9}},
                         add_cells);
  table.notes.emplace_back("beyond: runs whose error exceeds the objective");
  return table;
}

}  // namespace

std::string comparison_text(std::span<const ComparedCampaign> members, const MemberNames& names,
                            Paint paint) {
  const TerminalStyle style = document_style(paint);
  std::string text = terminal_text(campaign_table(members, names), style) + "\n" +
                     terminal_text(definition_table(members, names), style);
  if (std::ranges::any_of(members, has_changes)) {
    text += "\n" + terminal_text(bias_table(members, names), style) + "\n" +
            terminal_text(scatter_table(members, names), style);
  }
  return text + "\n" + terminal_text(magnitude_table(members, names), style);
}

namespace {

Json json_of(const ComparedAccuracy& accuracy) {
  return {{"bias", accuracy.bias},
          {"standard_deviation", accuracy.standard_deviation},
          {"mean_magnitude", accuracy.mean},
          {"worst_magnitude", accuracy.worst},
          {"num_in_tail", accuracy.num_in_tail}};
}

Json json_of(const ChangePValues& p_values) {
  return {{"bias", p_values.location}, {"scatter", p_values.scale}, {"tail", p_values.tail}};
}

Json json_of(const ParameterComparison& parameter) {
  return {{"parameter", parameter.quantity.name},
          {"unit", parameter.quantity.unit},
          {"tail_limit", parameter.tail_limit},
          {"first", json_of(parameter.first)},
          {"second", json_of(parameter.second)},
          {"bias_change", parameter.bias_change},
          {"bias_change_interval", parameter.bias_interval},
          {"smallest_scatter_factor", parameter.smallest_scale_factor},
          {"p_values", json_of(parameter.p_values)},
          {"adjusted_p_values", json_of(parameter.adjusted_p_values)}};
}

/// The comparison of a campaign with the first, complete and in SI units.
Json comparison_object(const ComparedCampaign& first, const ComparedCampaign& second) {
  const CampaignComparison& comparison = *second.comparison;
  const auto of_difference = [](const DefinitionDifference& of) -> Json {
    return {{"field", of.field}, {"first", of.first}, {"second", of.second}};
  };
  const auto of_parameter = [](const ParameterComparison& of) { return json_of(of); };
  const auto name_of = [](const Quantity& of) -> Json { return of.name; };
  const bool is_compared = comparison.why_not_compared.empty();
  return {
      {"first", first.file.string()},
      {"second", second.file.string()},
      {"differences", array_of(comparison.differences, of_difference)},
      {"is_paired", comparison.is_paired()},
      {"why_unpaired", text_or_null(comparison.why_unpaired)},
      {"why_not_compared", text_or_null(comparison.why_not_compared)},
      {"num_first", comparison.first.num_estimated},
      {"num_second", comparison.second.num_estimated},
      {"num_pairs", comparison.is_paired() ? Json(comparison.num_pairs) : Json(nullptr)},
      {"num_tested_first", comparison.first.num_tested},
      {"num_tested_second", comparison.second.num_tested},
      {"is_identical", second.results.digests.results == first.results.digests.results},
      {"num_first_without_estimate", first.results.missing.total()},
      {"num_second_without_estimate", second.results.missing.total()},
      {"confidence", default_confidence},
      {"only_in_first", array_of(lacking(first.quantities, second.quantities), name_of)},
      {"only_in_second", array_of(lacking(second.quantities, first.quantities), name_of)},
      {"parameters", is_compared ? array_of(comparison.parameters, of_parameter) : Json::array()}};
}

Json accuracy_json(const ComparedCampaign& member, std::size_t i, double objective) {
  const Quantity& quantity = member.quantities[i];
  const CampaignStatistics& statistics = member.results.statistics;
  const AccuracyStatistic& accuracy = statistics.accuracy[i];
  const auto if_runs = [&](std::uint64_t least, const auto& value) {
    return statistics.num_estimated >= least ? Json(value) : Json(nullptr);
  };
  return {{"parameter", quantity.name},
          {"unit", quantity.unit},
          {"objective", objective},  // Infinity becomes null.
          {"worst", if_runs(1, accuracy.worst)},
          {"mean", if_runs(1, accuracy.mean)},
          {"standard_deviation", if_runs(2, accuracy.standard_deviation)},
          {"num_beyond_objective", if_runs(1, accuracy.num_beyond_objective)}};
}

Json member_json(const ComparedCampaign& member, const ComparedCampaign& first) {
  Json json{{"file", member.file.string()},
            {"num_runs", member.campaign->num_runs},
            {"num_finished", member.results.statistics.num_runs},
            {"num_with_estimate", member.results.statistics.num_estimated},
            {"num_left_out", member.num_left_out},
            {"num_without_estimate", member.results.missing.total()},
            {"digest", member.results.digests.results},
            {"parameters", Json::array()},
            {"comparison", nullptr}};
  const std::vector<double> objectives = member.campaign->objectives();
  for (std::size_t i = 0; i < objectives.size(); ++i) {
    json["parameters"].push_back(accuracy_json(member, i, objectives[i]));
  }
  if (member.comparison) json["comparison"] = comparison_object(first, member);
  return json;
}

}  // namespace

Json comparison_json(std::span<const ComparedCampaign> members,
                     std::span<const std::vector<KeyText>> varied) {
  if (members.size() == 2 && varied.empty()) return comparison_object(members[0], members[1]);
  Json json{{"confidence", default_confidence}, {"campaigns", Json::array()}};
  for (std::size_t i = 0; i < members.size(); ++i) {
    Json member = member_json(members[i], members.front());
    if (!varied.empty()) {
      Json values = Json::object();
      for (const auto& [key, value] : varied[i]) values[key] = value;
      member["varied"] = values;
    }
    json["campaigns"].push_back(std::move(member));
  }
  return json;
}

}  // namespace proofmass::coordinator
