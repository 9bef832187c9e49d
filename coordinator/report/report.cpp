#include "coordinator/report/report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "coordinator/report/requirements.hpp"
#include "coordinator/report/summarise.hpp"
#include "coordinator/report/text_cells.hpp"
#include "core/campaign/campaign.hpp"
#include "core/model.hpp"
#include "core/statistics/comparison.hpp"
#include "core/statistics/distribution.hpp"
#include "core/statistics/interval.hpp"

namespace proofmass::coordinator {
namespace {

// Widths of columns include the blanks between them. Columns of one table add up to 80 at most.

constexpr std::string_view ours = "this campaign";
constexpr std::string_view theirs = "the paper";

constexpr std::array<TextColumn, 10> accuracy_columns{{{"parameter", 11, true},
                                                       {"unit", 9, true},
                                                       {"objective", 9},
                                                       {"worst", 8, false, ours},
                                                       {"mean", 8, false, ours},
                                                       {"std", 8, false, ours},
                                                       {"beyond", 8, false, ours},
                                                       {"worst", 6, false, theirs, true},
                                                       {"mean", 6, false, theirs},
                                                       {"std", 6, false, theirs}}};

constexpr std::array<TextColumn, 9> interval_columns{{{"parameter", 11, true},
                                                      {"mean", 8, false, "|error|"},
                                                      {"from", 8, false, "|error|"},
                                                      {"to", 9, false, "|error|"},
                                                      {"std", 8, false, "|error|", true},
                                                      {"from", 8, false, "|error|"},
                                                      {"to", 9, false, "|error|"},
                                                      {"bias", 9, false, "error", true},
                                                      {"skew", 7, false, "error"}}};

constexpr std::string_view percentiles = "percentiles of |error|";
static_assert(percentile_levels == std::array{0.5, 0.9, 0.95, 0.99});
constexpr std::array<TextColumn, 9> error_columns{{{"parameter", 10, true},
                                                   {"from", 9, false, "bias"},
                                                   {"to", 10, false, "bias"},
                                                   {"50 %", 8, false, percentiles, true},
                                                   {"90 %", 8, false, percentiles},
                                                   {"95 %", 8, false, percentiles},
                                                   {"99 %", 9, false, percentiles},
                                                   {"from", 7, false, "beyond, %", true},
                                                   {"to", 8, false, "beyond, %"}}};

constexpr std::array<TextColumn, 7> budget_text_columns{{{"term", 23, true},
                                                         {"before", 9, false, ours},
                                                         {"worst", 9, false, ours},
                                                         {"mean", 10, false, ours},
                                                         {"before", 9, false, theirs, true},
                                                         {"worst", 9, false, theirs},
                                                         {"mean", 9, false, theirs}}};

using Cells = std::vector<std::string>;

std::string row_of(std::span<const TextColumn> columns, const Cells& cells) {
  return table_row(columns, cells, WideCell::keep);
}

std::string accuracy_row(const Quantity& quantity, double objective,
                         const AccuracyStatistic& accuracy, std::uint64_t num_runs) {
  const double scale = quantity.display_scale;
  Cells cells{std::string(quantity.symbol), std::string(quantity.display_unit),
              std::isfinite(objective) ? given_figure(objective / scale) : "-"};
  const std::uint64_t beyond = accuracy.num_beyond_objective;
  cells.push_back(num_runs < 1 ? "-" : measured_figure(accuracy.worst / scale));
  cells.push_back(num_runs < 1 ? "-" : measured_figure(accuracy.mean / scale));
  cells.push_back(num_runs < 2 ? "-" : measured_figure(accuracy.standard_deviation / scale));
  cells.push_back(num_runs < 1         ? "-"
                  : beyond < 1'000'000 ? std::to_string(beyond)
                                       : measured_figure(static_cast<double>(beyond)));
  const auto& published = quantity.published;
  for (const double PublishedAccuracy::*figure :
       {&PublishedAccuracy::worst, &PublishedAccuracy::mean,
        &PublishedAccuracy::standard_deviation}) {
    cells.push_back(published ? given_figure((*published).*figure / scale) : "");
  }
  return row_of(accuracy_columns, cells);
}

// Of |error|: of few runs the symmetric interval of a mean may begin below 0, where none can lie.
void add_triple(double value, const std::optional<Interval>& interval, double scale, Cells& cells) {
  const auto figure = [&](double number) { return measured_figure(std::max(number, 0.0) / scale); };
  cells.push_back(figure(value));
  cells.push_back(interval ? figure(interval->lower) : "-");
  cells.push_back(interval ? figure(interval->upper) : "-");
}

std::string interval_row(const Quantity& quantity, const AccuracyStatistic& accuracy,
                         std::uint64_t num_runs) {
  const double scale = quantity.display_scale;
  Cells cells{std::string(quantity.symbol)};
  add_triple(accuracy.mean, accuracy.mean_interval, scale, cells);
  if (num_runs < 2) {
    cells.insert(cells.end(), 3, "-");
  } else {
    add_triple(accuracy.standard_deviation, accuracy.deviation_interval, scale, cells);
  }
  cells.push_back(signed_figure(accuracy.error.bias / scale));
  cells.push_back(num_runs < 3 ? "-" : fmt::format("{:.2f}", accuracy.error.skewness));
  return row_of(interval_columns, cells);
}

/// Fewest runs from which on the bootstrap covers what it says; core/statistics/README.md.
constexpr std::uint64_t num_runs_of_bootstrap = 200;

constexpr std::string_view of_one_parameter = "  (one parameter by itself, not all together)\n";

/// What "the worst of n" is worth [Wilks1941].
std::string worth_of_worst(std::uint64_t num_runs, std::uint64_t num_without_estimate) {
  const double coverage = std::pow(1.0 - default_confidence, 1.0 / static_cast<double>(num_runs));
  // Rounded down: no more is claimed than holds.
  const std::string text =
      fmt::format("worst of {}: with 95 % confidence {} % of all draws stay below", num_runs,
                  std::floor(coverage * 1e5) / 1e3);
  if (num_without_estimate == 0) return fmt::format("{}\n{}", text, of_one_parameter);
  return text + fmt::format(",\n  of those that have an estimate; {} more {} none\n{}",
                            num_without_estimate, num_without_estimate == 1 ? "has" : "have",
                            of_one_parameter);
}

std::string error_row(const Quantity& quantity, const AccuracyStatistic& accuracy) {
  const double scale = quantity.display_scale;
  const std::optional<Interval>& bias = accuracy.error.bias_interval;
  Cells cells{std::string(quantity.symbol), bias ? signed_figure(bias->lower / scale) : "-",
              bias ? signed_figure(bias->upper / scale) : "-"};
  for (const PercentileStatistic& percentile : accuracy.percentiles) {
    cells.push_back(measured_figure(percentile.value / scale));
  }
  const bool is_known = accuracy.beyond_objective.upper - accuracy.beyond_objective.lower < 1.0;
  for (const double share : {accuracy.beyond_objective.lower, accuracy.beyond_objective.upper}) {
    cells.push_back(is_known ? measured_figure(100.0 * share) : "-");
  }
  return row_of(error_columns, cells);
}

/// That chance alone makes such a bias, by Student's law; 1 where nothing is known.
double bias_p_value(const ErrorStatistic& error, std::uint64_t num_runs) {
  if (num_runs < 2 || error.bias == 0.0) return 1.0;
  if (error.standard_deviation <= 0.0) return 0.0;
  const auto n = static_cast<double>(num_runs);
  return student_two_sided(error.bias * std::sqrt(n) / error.standard_deviation, n - 1.0);
}

std::string joint_text(const CampaignStatistics& statistics, std::uint64_t num_given_up) {
  constexpr std::size_t margin = 2;
  const std::string seen =
      fmt::format("all objectives together: {} of {} runs", statistics.num_within_objectives,
                  statistics.num_runs + num_given_up);
  const std::optional<Interval> share = statistics.within_objectives(num_given_up);
  if (!share) return seen + "\n";
  return line_of(seen + ",", interval_percent(*share) + " of all draws", margin);
}

// Contributions before estimation and after it, with the worst and the mean errors.
using Figures = std::array<std::optional<double>, 3>;

std::string budget_row(const BudgetEntryInfo& info, const Figures& figures) {
  Cells cells{std::string(info.label)};
  const Figures paper{info.paper_before, info.paper_after_worst, info.paper_after_mean};
  for (const Figures& side : {figures, paper}) {
    for (const auto& figure : side) cells.push_back(figure ? fmt::format("{:.1e}", *figure) : "-");
  }
  return row_of(budget_text_columns, cells);
}

// Published totals, too, add up the worst errors of all parameters, which no single run has.
std::string totals_text(const RunTotals& totals) {
  return fmt::format(
      "worst adds up the worst errors of different runs, as the paper does; totals of\n"
      "single runs: median {:.1e}, 95 % below {:.1e}, worst {:.1e} (run {})\n",
      totals.median, totals.percentile_95, totals.worst, totals.worst_run.value);
}

std::string report_of_one_state(const Store& store, const Campaign& campaign) {
  const auto [results, check, given_up] = read_checked_results(store, campaign);
  const CampaignStatistics& statistics = results.statistics;
  const std::uint64_t num_given_up = num_runs_in(given_up);
  std::string text = summary_text(store.name(), store.seed(), store.num_runs(), statistics,
                                  results.digests.results, check) +
                     given_up_text(given_up) + warnings_text(results.warnings) + stop_text(store);
  for (const std::string& table :
       {accuracy_table(campaign, statistics), interval_table(statistics, num_given_up),
        error_table(statistics, num_given_up),
        budget_table(campaign, statistics, results.totals)}) {
    if (!table.empty()) text += "\n" + table;
  }
  return text;
}

}  // namespace

std::string report_text(const Store& store, const Campaign& campaign) {
  std::string text;
  store.read_one_state([&] { text = report_of_one_state(store, campaign); });
  return text;
}

std::string summary_text(std::string_view name, std::uint64_t seed, std::uint64_t num_runs,
                         const CampaignStatistics& statistics, std::string_view digest,
                         DigestCheck check) {
  const std::uint64_t num_imperfect = statistics.num_not_converged + statistics.num_not_finite +
                                      statistics.num_no_draw + statistics.num_lost;
  std::string text = fmt::format("Campaign  {}\nSeed      {}\nDigest    {}\n", name, seed, digest);
  if (check == DigestCheck::not_checked) {
    text += fmt::format("          (not checked: no stored one of these {} runs)\n",
                        statistics.num_runs);
  }
  text += fmt::format("Runs      {} finished of {}, {} completed\n", statistics.num_runs, num_runs,
                      statistics.num_runs - num_imperfect);
  if (num_imperfect > 0) {
    text += fmt::format(
        "          {} not converged, {} not finite, {} without draw{}\n",
        statistics.num_not_converged, statistics.num_not_finite, statistics.num_no_draw,
        statistics.num_lost > 0 ? fmt::format(", {} lost", statistics.num_lost) : std::string());
  }
  return text;
}

std::string bias_sentence(const CampaignStatistics& statistics) {
  std::vector<double> p_values;
  for (const AccuracyStatistic& accuracy : statistics.accuracy) {
    p_values.push_back(bias_p_value(accuracy.error, statistics.num_estimated));
  }
  const std::vector<double> adjusted = holm_adjusted(p_values);
  std::string names;
  for (std::size_t i = 0; i < adjusted.size(); ++i) {
    if (adjusted[i] >= 1.0 - default_confidence) continue;
    names += (names.empty() ? "" : ", ") + std::string(model().results().quantities[i].symbol);
  }
  return fmt::format(
      "Bias: each interval holds by itself. Of all {} together (Holm, 5 %) {}.", adjusted.size(),
      names.empty() ? "no bias differs from 0" : "the bias differs from 0 of " + names);
}

std::string given_up_text(std::span<const RunRange> given_up) {
  if (given_up.empty()) return "";
  constexpr std::size_t columns_max = 76;  // And an ellipsis.
  std::string line =
      fmt::format("          {} given up, having crashed workers:", num_runs_in(given_up));
  for (const RunRange& range : given_up) {
    const std::string item = range.count == 1
                                 ? fmt::format(" {}", range.first.value)
                                 : fmt::format(" {}..{}", range.first.value, range.end() - 1);
    if (line.size() + item.size() > columns_max) return line + " ...\n";
    line += item;
  }
  return line + "\n";
}

std::string accuracy_table(const Campaign& campaign, const CampaignStatistics& statistics) {
  std::string text = fmt::format(
      "Accuracy of the estimates: |estimate − truth| of {} {}\n\n{}", statistics.num_estimated,
      statistics.num_estimated == 1 ? "run" : "runs", table_heading(accuracy_columns));
  const std::vector<double> objectives = campaign.objectives();
  const ResultSchema& schema = model().results();
  const std::vector<Quantity>& quantities = schema.quantities;
  for (std::size_t i = 0; i < quantities.size(); ++i) {
    const bool has_runs = statistics.num_estimated > 0;
    text += accuracy_row(quantities[i], objectives[i],
                         has_runs ? statistics.accuracy[i] : AccuracyStatistic{},
                         statistics.num_estimated);
  }
  text += "beyond: runs whose error exceeds the objective";
  if (!schema.published_source.empty()) {
    text += fmt::format("; {}: {}", theirs, schema.published_source);
  }
  return text + "\n";
}

std::string interval_table(const CampaignStatistics& statistics, std::uint64_t num_given_up) {
  if (statistics.num_estimated == 0) return "";
  std::string text = "95 % intervals, in the units above\n\n" + table_heading(interval_columns);
  for (std::size_t i = 0; i < statistics.accuracy.size(); ++i) {
    text += interval_row(model().results().quantities[i], statistics.accuracy[i],
                         statistics.num_estimated);
  }
  if (!statistics.are_draws_independent) {
    return text +
           "no intervals: a table of the dispersion is not declared independent, so that\n"
           "  the draws may be those of a design\n";
  }
  if (statistics.num_estimated < num_runs_of_bootstrap) {
    text += "std: an interval from fewer than 200 runs is too narrow, see core/statistics\n";
  }
  return text + worth_of_worst(statistics.num_estimated,
                               statistics.num_runs - statistics.num_estimated + num_given_up);
}

std::string error_table(const CampaignStatistics& statistics, std::uint64_t num_given_up) {
  if (statistics.num_estimated == 0) return "";
  std::string text =
      "95 % intervals of bias and of draws beyond the objective\n\n" + table_heading(error_columns);
  for (std::size_t i = 0; i < statistics.accuracy.size(); ++i) {
    text += error_row(model().results().quantities[i], statistics.accuracy[i]);
  }
  if (statistics.are_draws_independent) text += wrapped(bias_sentence(statistics), 2) + "\n";
  return text + joint_text(statistics, num_given_up);
}

std::string level_text(const ErrorBudget& budget, const CampaignStatistics& statistics,
                       std::string (*figure)(double)) {
  const std::string_view unit = model().results().health.at(budget.level).unit;
  if (statistics.health.empty() || statistics.health.at(budget.level).worst == 0.0) {
    return fmt::format("{} is assumed: {} {}", budget.level_label, figure(budget.assumed_level),
                       unit);
  }
  const HealthStatistic& level = statistics.health.at(budget.level);
  return fmt::format("{} is that of the runs: worst {}, mean {} {}; assumed was {}",
                     budget.level_label, figure(level.worst), figure(level.mean), unit,
                     figure(budget.assumed_level));
}

std::string budget_table(const Campaign& campaign, const CampaignStatistics& statistics,
                         const std::optional<RunTotals>& totals) {
  const std::optional<ErrorBudget> budget = campaign.error_budget();
  if (!budget) return "";
  const BudgetColumns columns = budget_columns(*budget, statistics);
  const auto figures = [&](const auto& value_of) -> Figures {
    if (!columns.after_worst) return {value_of(columns.before), std::nullopt, std::nullopt};
    return {value_of(columns.before), value_of(*columns.after_worst),
            value_of(*columns.after_mean)};
  };
  std::string text = fmt::format("{}\n\n{}", budget->title, table_heading(budget_text_columns));
  for (std::size_t i = 0; i < budget->terms.size(); ++i) {
    text +=
        budget_row(budget->terms[i].info, figures([&](const Budget& of) { return of.entries[i]; }));
  }
  text +=
      table_rule(budget_text_columns) +
      budget_row(budget->total_info, figures([](const Budget& of) { return of.total; })) +
      "before: bounds of construction; worst, mean: left by errors of the estimates\n" +
      level_text(*budget, statistics, [](double value) { return fmt::format("{:.3g}", value); }) +
      "\n" + budget->note;
  return totals ? text + totals_text(*totals) : text;
}

}  // namespace proofmass::coordinator
