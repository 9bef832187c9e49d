#include <nlohmann/json.hpp>

#include "coordinator/archive/comparison_text.hpp"
#include "core/campaign/model.hpp"

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

Json json_of(const Quantity& quantity, const ParameterComparison& parameter) {
  Json json{{"parameter", quantity.name},
            {"unit", quantity.unit},
            {"tail_limit", parameter.tail_limit},
            {"first", json_of(parameter.first)},
            {"second", json_of(parameter.second)},
            {"bias_change", parameter.second.bias - parameter.first.bias},
            {"bias_change_interval", nullptr},
            {"p_values", json_of(parameter.p_values)},
            {"adjusted_p_values", json_of(parameter.adjusted_p_values)}};
  if (parameter.bias_interval) {
    json["bias_change_interval"] = {parameter.bias_interval->lower, parameter.bias_interval->upper};
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
    for (std::size_t i = 0; i < comparison.parameters.size(); ++i) {
      const Quantity& quantity = model().results().quantities[i];
      json["parameters"].push_back(json_of(quantity, comparison.parameters[i]));
    }
  }
  constexpr int indent = 2;
  return json.dump(indent, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace proofmass::coordinator
