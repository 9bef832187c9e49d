#include "coordinator/report/sensitivity_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "coordinator/report/text_cells.hpp"
#include "core/error.hpp"
#include "core/statistics/sensitivity.hpp"

namespace proofmass::coordinator {
namespace {

constexpr std::size_t name_width = 40;
constexpr std::size_t share_width = 16;
constexpr std::size_t rank_width = 24;
constexpr std::size_t value_width = 14;
constexpr std::size_t percentile_width = 12;

std::vector<double> magnitudes_of(const std::vector<double>& errors) {
  std::vector<double> magnitudes(errors.size());
  std::ranges::transform(errors, magnitudes.begin(), [](double error) { return std::abs(error); });
  return magnitudes;
}

/// Of error and |error|, largest first-order index first.
std::vector<std::vector<Sensitivity>> sensitivities_of(const DrawnRuns& drawn,
                                                       Parameter parameter) {
  const std::vector<double>& errors = drawn.errors[index(parameter)];
  const std::vector<double> magnitudes = magnitudes_of(errors);
  const std::vector<Column> inputs(drawn.columns.begin(), drawn.columns.end());
  const std::vector<Column> outputs{errors, magnitudes};
  return sensitivities(inputs, outputs, default_confidence);
}

std::string share_of(const FirstOrderIndex& index) {
  return fmt::format("{:.1f} ± {:.1f} %", 100.0 * index.index, 100.0 * index.standard_error);
}

std::string sensitivity_rows(const DrawnRuns& drawn, std::span<const Sensitivity> rows,
                             std::string_view output) {
  std::string text = left_aligned(fmt::format("drives {}", output), name_width) +
                     right_aligned("of variance", share_width) +
                     right_aligned("rank correlation (95 %)", rank_width) + "\n" +
                     horizontal_rule(name_width + share_width + rank_width) + "\n";
  for (const Sensitivity& row : rows) {
    const auto& [coefficient, interval] = row.rank;
    text += left_aligned(drawn.names[row.input], name_width) +
            right_aligned(share_of(row.first_order), share_width) +
            right_aligned(fmt::format("{:+.2f} ({:+.2f}, {:+.2f})", coefficient, interval.lower,
                                      interval.upper),
                          rank_width) +
            "\n";
  }
  return text;
}

std::string noise_line(const std::vector<Sensitivity>& rows) {
  if (rows.empty()) return "";
  return fmt::format(
      "±: standard error; without influence above {:.1f} % with 1 of 20, by chance\n",
      100.0 * rows.front().first_order.noise_level);
}

std::string left_out(const DrawnRuns& drawn) {
  const std::string reasons = reasons_text(drawn.missing);
  return reasons.empty() ? "" : fmt::format("Left out, without an estimate: {}\n", reasons);
}

std::span<const Sensitivity> first_of(const std::vector<Sensitivity>& rows, std::size_t num_rows) {
  return std::span(rows).first(std::min(num_rows, rows.size()));
}

std::size_t position_of(const DrawnRuns& drawn, RunIndex run) {
  const auto found = std::ranges::lower_bound(drawn.runs, run);
  if (found == drawn.runs.end() || *found != run) {
    const std::string last = drawn.runs.empty() ? "none" : fmt::to_string(drawn.runs.back().value);
    throw InvalidArgument(fmt::format("run = {} (must have an estimate, as {} runs up to {} have)",
                                      run.value, drawn.runs.size(), last));
  }
  return static_cast<std::size_t>(found - drawn.runs.begin());
}

/// 1 for the largest |error|.
std::size_t rank_of(const std::vector<double>& errors, std::size_t position) {
  const double magnitude = std::abs(errors[position]);
  return 1 + static_cast<std::size_t>(std::ranges::count_if(
                 errors, [&](double error) { return std::abs(error) > magnitude; }));
}

double percentile_of(const std::vector<double>& values, double value) {
  const auto below = std::ranges::count_if(values, [&](double other) { return other < value; });
  return 100.0 * static_cast<double>(below) / static_cast<double>(values.size());
}

std::string explanation_rows(const DrawnRuns& drawn, std::span<const Sensitivity> rows,
                             std::size_t position, std::string_view output) {
  std::string text =
      left_aligned(fmt::format("drives {}", output), name_width) +
      right_aligned("of variance", share_width) + right_aligned("its value", value_width - 2) +
      right_aligned("percentile", percentile_width) + "\n" +
      horizontal_rule(name_width + share_width + value_width + percentile_width - 2) + "\n";
  for (const Sensitivity& row : rows) {
    const std::vector<double>& values = drawn.columns[row.input];
    const double value = values[position];
    text += left_aligned(drawn.names[row.input], name_width) +
            right_aligned(share_of(row.first_order), share_width) +
            right_aligned(fmt::format("{:.3g}", value), value_width - 2) +
            right_aligned(fmt::format("{:.1f}", percentile_of(values, value)), percentile_width) +
            "\n";
  }
  return text;
}

}  // namespace

std::string sensitivity_text(const DrawnRuns& drawn, Parameter parameter, std::size_t num_rows) {
  const auto both = sensitivities_of(drawn, parameter);
  return fmt::format(
      "{}: {} runs\n{}\n{}\n{}{}", parameter_infos()[index(parameter)].label, drawn.runs.size(),
      left_out(drawn), sensitivity_rows(drawn, first_of(both[1], num_rows), "|error|"),
      sensitivity_rows(drawn, first_of(both[0], num_rows), "error"), noise_line(both[1]));
}

std::string explanation_text(const DrawnRuns& drawn, Parameter parameter, RunIndex run,
                             std::size_t num_rows) {
  const std::size_t position = position_of(drawn, run);
  const ParameterInfo& info = parameter_infos()[index(parameter)];
  const std::vector<double>& errors = drawn.errors[index(parameter)];
  const auto both = sensitivities_of(drawn, parameter);
  return fmt::format("Run {}: error of {} {:.3g} {}, rank {} of {}\n{}\n{}\n{}{}", run.value,
                     info.label, errors[position] / info.display_scale, info.display_unit,
                     rank_of(errors, position), errors.size(), left_out(drawn),
                     explanation_rows(drawn, first_of(both[1], num_rows), position, "|error|"),
                     explanation_rows(drawn, first_of(both[0], num_rows), position, "error"),
                     noise_line(both[1]));
}

Parameter worst_parameter_of(const DrawnRuns& drawn, RunIndex run) {
  const std::size_t position = position_of(drawn, run);
  const auto& infos = parameter_infos();
  return std::ranges::min_element(infos, {},
                                  [&](const ParameterInfo& info) {
                                    return rank_of(drawn.errors[index(info.parameter)], position);
                                  })
      ->parameter;
}

}  // namespace proofmass::coordinator
