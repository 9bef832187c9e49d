#include <cstddef>

#include "coordinator/archive/comparison.hpp"
#include "coordinator/report/json.hpp"

namespace proofmass::coordinator {
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
      {"only_in_first", lacking(first.quantities, second.quantities)},
      {"only_in_second", lacking(second.quantities, first.quantities)},
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
