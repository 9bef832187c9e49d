#include <nlohmann/json.hpp>

#include "coordinator/archive/comparison_text.hpp"

namespace proofmass::coordinator {
namespace {

using Json = nlohmann::ordered_json;

Json text_or_null(const std::string& text) { return text.empty() ? Json(nullptr) : Json(text); }

Json json_of(const ComparedAccuracy& accuracy) {
  return {{"worst", accuracy.worst},
          {"mean", accuracy.mean},
          {"standard_deviation", accuracy.standard_deviation}};
}

Json json_of(const ParameterInfo& info, const ParameterComparison& parameter) {
  Json json{{"parameter", info.name},
            {"unit", info.unit},
            {"first", json_of(parameter.first)},
            {"second", json_of(parameter.second)},
            {"mean_change", parameter.mean_change},
            {"mean_change_interval", nullptr},
            {"p_value", parameter.p_value},
            {"adjusted_p_value", parameter.adjusted_p_value}};
  if (parameter.interval) {
    json["mean_change_interval"] = {parameter.interval->lower, parameter.interval->upper};
  }
  return json;
}

}  // namespace

std::string comparison_json(const CampaignComparison& comparison, std::string_view first,
                            std::string_view second) {
  Json json{{"first", first},
            {"second", second},
            {"differences", Json::array()},
            {"is_paired", comparison.is_paired()},
            {"why_unpaired", text_or_null(comparison.why_unpaired)},
            {"why_not_compared", text_or_null(comparison.why_not_compared)},
            {"num_first", comparison.num_first},
            {"num_second", comparison.num_second},
            {"num_first_without_estimate", comparison.missing_in_first.total()},
            {"num_second_without_estimate", comparison.missing_in_second.total()},
            {"confidence", default_confidence},
            {"parameters", Json::array()}};
  for (const auto& [field, of_first, of_second] : comparison.differences) {
    json["differences"].push_back({{"field", field}, {"first", of_first}, {"second", of_second}});
  }
  if (comparison.why_not_compared.empty()) {
    for (const ParameterInfo& info : parameter_infos()) {
      json["parameters"].push_back(json_of(info, comparison.parameters[index(info.parameter)]));
    }
  }
  constexpr int indent = 2;
  return json.dump(indent, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace proofmass::coordinator
