#include "coordinator/archive/comparison_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <vector>

#include "coordinator/archive/detail/comparison_json.hpp"
#include "coordinator/report/text_cells.hpp"
#include "core/model.hpp"
#include "core/statistics/comparison.hpp"

namespace proofmass::coordinator {
namespace {

constexpr std::size_t line_width = 80;

constexpr std::array<TextColumn, 9> bias_columns{{{"parameter", 11, true},
                                                  {"unit", 9, true},
                                                  {"A", 9},
                                                  {"B", 9},
                                                  {"change", 10},
                                                  {"from", 10},
                                                  {"to", 10},
                                                  {"p", 9},
                                                  {"", 2, true}}};

constexpr std::array<TextColumn, 11> scatter_columns{{{"parameter", 11, true},
                                                      {"unit", 9, true},
                                                      {"std A", 8},
                                                      {"std B", 8},
                                                      {"p", 8},
                                                      {"", 2, true},
                                                      {"found", 8},
                                                      {"tail A", 8},
                                                      {"tail B", 8},
                                                      {"p", 8},
                                                      {"", 2, true}}};

constexpr std::array<TextColumn, 6> magnitude_columns{{{"parameter", 11, true},
                                                       {"unit", 9, true},
                                                       {"mean A", 10},
                                                       {"mean B", 10},
                                                       {"worst A", 10},
                                                       {"worst B", 10}}};

constexpr double significance = 1.0 - default_confidence;

std::string figure_with_sign(double value) {
  const std::string figure = measured_figure(std::abs(value));
  if (figure == "0") return figure;
  return (value < 0.0 ? "-" : "+") + figure;
}

std::string definitions(const CampaignComparison& comparison) {
  if (comparison.differences.empty()) return "The definitions agree.\n";
  std::string text = "The definitions differ:\n";
  for (const auto& [field, first, second] : comparison.differences) {
    const std::string line = fmt::format("  {}: {} in A, {} in B", field, first, second);
    text += display_width(line) <= line_width
                ? line + "\n"
                : fmt::format("  {}\n    A  {}\n    B  {}\n", field, first, second);
  }
  return text;
}

std::string basis(const CampaignComparison& comparison) {
  if (!comparison.why_not_compared.empty()) {
    return line_of("The results cannot be compared:", comparison.why_not_compared + ".", 0);
  }
  if (comparison.is_paired()) {
    return fmt::format("Compared run by run: {} {} of the same draws.\n", comparison.num_first,
                       comparison.num_first == 1 ? "run" : "runs");
  }
  return fmt::format("Compared as a whole, as {}: {} runs of A, {} of B.\n",
                     comparison.why_unpaired, comparison.num_first, comparison.num_second);
}

std::string left_out(const CampaignComparison& comparison) {
  std::string text;
  for (const auto& [name, missing] : {std::pair("A", comparison.missing_in_first),
                                      std::pair("B", comparison.missing_in_second)}) {
    if (missing.total() == 0) continue;
    text += fmt::format("Left out of {}, without an estimate: {}.\n", name, reasons_text(missing));
  }
  return text;
}

using Cells = std::vector<std::string>;

Cells label_cells(const Quantity& quantity) {
  return {std::string(quantity.symbol), std::string(quantity.display_unit)};
}

/// The p-value, and a mark if it is significant.
void add_p(double p_value, Cells& cells) {
  cells.push_back(measured_figure(p_value));
  cells.emplace_back(p_value < significance ? " *" : "");
}

std::string bias_row(const Quantity& quantity, const ParameterComparison& parameter) {
  const double scale = quantity.display_scale;
  Cells cells = label_cells(quantity);
  for (const double bias : {parameter.first.bias, parameter.second.bias,
                            parameter.second.bias - parameter.first.bias}) {
    cells.push_back(figure_with_sign(bias / scale));
  }
  const auto& interval = parameter.bias_interval;
  cells.push_back(interval ? figure_with_sign(interval->lower / scale) : "-");
  cells.push_back(interval ? figure_with_sign(interval->upper / scale) : "-");
  add_p(parameter.adjusted_p_values.location, cells);
  return table_row(bias_columns, cells, WideCell::keep);
}

/// The tests of bias, scatter and tail.
struct TestNames {
  std::string_view bias, scatter, tail;
};

TestNames tests_of(const CampaignComparison& comparison) {
  if (comparison.is_paired()) {
    return {"Wilcoxon's signed ranks", "Wilcoxon's signed ranks", "sign test"};
  }
  return std::min(comparison.num_first, comparison.num_second) < num_welch_min
             ? TestNames{"larger of Welch's and Smirnov's test",
                         "larger of Welch's and Smirnov's test", "Fisher's exact test"}
             : TestNames{"Welch's t", "Welch's t", "Fisher's exact test"};
}

std::string bias_table(const CampaignComparison& comparison) {
  std::string text = "Bias: mean of estimate − truth\n\n" + table_heading(bias_columns);
  for (std::size_t i = 0; i < comparison.parameters.size(); ++i) {
    const Quantity& quantity = model().results().quantities[i];
    text += bias_row(quantity, comparison.parameters[i]);
  }
  return text +
         fmt::format("from, to: 95 % interval of the change; p: {}\n", tests_of(comparison).bias);
}

std::string percent(std::size_t count, std::size_t of) {
  return fmt::format("{:.1f} %", 100.0 * static_cast<double>(count) / static_cast<double>(of));
}

std::string scatter_table(const CampaignComparison& comparison) {
  std::string text =
      "Scatter and tail: standard deviation of estimate − truth, and runs far off\n\n" +
      table_heading(scatter_columns);
  for (std::size_t i = 0; i < comparison.parameters.size(); ++i) {
    const Quantity& quantity = model().results().quantities[i];
    const auto& parameter = comparison.parameters[i];
    Cells cells = label_cells(quantity);
    for (const ComparedAccuracy& side : {parameter.first, parameter.second}) {
      cells.push_back(measured_figure(side.standard_deviation / quantity.display_scale));
    }
    add_p(parameter.adjusted_p_values.scale, cells);
    const auto& factor = parameter.smallest_scale_factor;
    cells.push_back(factor ? measured_figure(100.0 * (*factor - 1.0)) + " %" : "-");
    cells.push_back(percent(parameter.first.num_in_tail, comparison.num_first));
    cells.push_back(percent(parameter.second.num_in_tail, comparison.num_second));
    add_p(parameter.adjusted_p_values.tail, cells);
    text += table_row(scatter_columns, cells, WideCell::keep);
  }
  const TestNames tests = tests_of(comparison);
  return text + fmt::format(
                    "p: {} of distances from the mean; found: the smallest\n"
                    "change of the scatter that this finds in {:.0f} % of such campaigns\n"
                    "tail: beyond twice the root mean square of A and B, p: {}\n"
                    "All p are adjusted for three tests of all parameters (Holm); *: below "
                    "{:.2f}\n",
                    tests.scatter, 100.0 * finding_probability, tests.tail, significance);
}

std::string magnitude_table(const CampaignComparison& comparison) {
  std::string text = "Mean and worst of |estimate − truth|\n\n" + table_heading(magnitude_columns);
  for (std::size_t i = 0; i < comparison.parameters.size(); ++i) {
    const Quantity& quantity = model().results().quantities[i];
    const auto& parameter = comparison.parameters[i];
    Cells cells = label_cells(quantity);
    for (const double value : {parameter.first.mean, parameter.second.mean, parameter.first.worst,
                               parameter.second.worst}) {
      cells.push_back(measured_figure(value / quantity.display_scale));
    }
    text += table_row(magnitude_columns, cells, WideCell::keep);
  }
  return text;
}

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

}  // namespace

std::string comparison_text(const CampaignComparison& comparison, std::string_view first,
                            std::string_view second) {
  std::string text = fmt::format("A  {}\nB  {}\n\n{}{}{}", first, second, definitions(comparison),
                                 basis(comparison), left_out(comparison));
  if (!comparison.why_not_compared.empty()) return text;
  return text + "\n" + bias_table(comparison) + "\n" + scatter_table(comparison) + "\n" +
         magnitude_table(comparison);
}

nlohmann::ordered_json detail::comparison_object(const CampaignComparison& comparison,
                                                 std::string_view first, std::string_view second) {
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
  return json;
}

std::string comparison_json(const CampaignComparison& comparison, std::string_view first,
                            std::string_view second) {
  constexpr int indent = 2;
  const Json json = detail::comparison_object(comparison, first, second);
  return json.dump(indent, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace proofmass::coordinator
