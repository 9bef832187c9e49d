#include <cmath>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <string>

#include "coordinator/archive/comparison.hpp"

namespace proofmass::coordinator {
namespace {

using Json = nlohmann::ordered_json;

Json text_or_null(const std::string& text) { return text.empty() ? Json(nullptr) : Json(text); }

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
  Json json{{"parameter", parameter.quantity.name},
            {"unit", parameter.quantity.unit},
            {"tail_limit", parameter.tail_limit},
            {"first", json_of(parameter.first)},
            {"second", json_of(parameter.second)},
            {"bias_change", parameter.bias_change},
            {"bias_change_interval", nullptr},
            {"smallest_scatter_factor", nullptr},
            {"p_values", json_of(parameter.p_values)},
            {"adjusted_p_values", json_of(parameter.adjusted_p_values)}};
  if (parameter.bias_interval) {
    json["bias_change_interval"] = {parameter.bias_interval->lower, parameter.bias_interval->upper};
  }
  if (parameter.smallest_scale_factor) {
    json["smallest_scatter_factor"] = *parameter.smallest_scale_factor;
  }
  return json;
}

/// The comparison of a campaign with the first, complete and in SI units.
Json comparison_object(const ComparedMember& first, const ComparedMember& second) {
  const CampaignComparison& comparison = *second.comparison;
  Json json{{"first", first.file.string()},
            {"second", second.file.string()},
            {"differences", Json::array()},
            {"is_paired", comparison.is_paired()},
            {"why_unpaired", text_or_null(comparison.why_unpaired)},
            {"why_not_compared", text_or_null(comparison.why_not_compared)},
            {"num_first", comparison.num_first},
            {"num_second", comparison.num_second},
            {"num_pairs", comparison.is_paired() ? Json(comparison.num_pairs) : Json(nullptr)},
            {"num_tested_first", comparison.num_tested_first},
            {"num_tested_second", comparison.num_tested_second},
            {"is_identical", second.digest == first.digest},
            {"num_first_without_estimate", first.missing.total()},
            {"num_second_without_estimate", second.missing.total()},
            {"confidence", default_confidence},
            {"only_in_first", lacking(first.quantities, second.quantities)},
            {"only_in_second", lacking(second.quantities, first.quantities)},
            {"parameters", Json::array()}};
  for (const auto& [field, of_first, of_second] : comparison.differences) {
    json["differences"].push_back({{"field", field}, {"first", of_first}, {"second", of_second}});
  }
  if (comparison.why_not_compared.empty()) {
    for (const ParameterComparison& parameter : comparison.parameters) {
      json["parameters"].push_back(json_of(parameter));
    }
  }
  return json;
}

Json accuracy_json(const ComparedMember& member, std::size_t i) {
  const Quantity& quantity = member.quantities[i];
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

Json member_json(const ComparedMember& member, const ComparedMember& first) {
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
  if (member.comparison) json["comparison"] = comparison_object(first, member);
  return json;
}

}  // namespace

std::string comparison_json(std::span<const ComparedMember> members,
                            std::span<const std::vector<KeyText>> varied) {
  constexpr int indent = 2;
  if (members.size() == 2 && varied.empty()) {
    const Json json = comparison_object(members[0], members[1]);
    return json.dump(indent, ' ', false, Json::error_handler_t::replace) + "\n";
  }
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
  return json.dump(indent, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace proofmass::coordinator
