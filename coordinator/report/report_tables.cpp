#include "coordinator/report/report_tables.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <sstream>
#include <string>
#include <vector>

#include "coordinator/charts/ticks.hpp"
#include "coordinator/report/requirements.hpp"
#include "coordinator/table/figures.hpp"
#include "core/statistics/comparison.hpp"
#include "core/statistics/distribution.hpp"
#include "core/statistics/interval.hpp"

namespace proofmass::coordinator {
namespace {

// Widths of columns include the blanks between them. Columns of one table add up to 80 at most.

constexpr const char* ours = "this campaign";
constexpr const char* theirs = "the paper";

/// As somebody gave it, without digits that nobody gave.
Cell given_cell(double value, double scale) {
  Cell cell = figure_cell(value, scale);
  cell.text = given_figure(value / scale);
  return cell;
}

Cell count_cell(std::uint64_t count, Tone tone) {
  const auto value = static_cast<double>(count);
  Cell cell(count < 1'000'000 ? std::to_string(count) : measured_figure(value), tone);
  cell.value = value;
  cell.document = std::to_string(count);
  return cell;
}

void add_published(const Quantity& quantity, Row& row) {
  for (const double PublishedAccuracy::*figure :
       {&PublishedAccuracy::worst, &PublishedAccuracy::mean,
        &PublishedAccuracy::standard_deviation}) {
    row.push_back(quantity.published
                      ? given_cell((*quantity.published).*figure, quantity.display_scale)
                      : Cell(""));
  }
}

Row accuracy_row(const Quantity& quantity, double objective, const AccuracyStatistic* accuracy,
                 std::uint64_t num_runs) {
  const double scale = quantity.display_scale;
  Row row{quantity.symbol, unit_cell(quantity),
          std::isfinite(objective) ? given_cell(objective, scale) : no_figure()};
  if (accuracy == nullptr) {
    row.insert(row.end(), 5, no_figure());
  } else {
    const std::uint64_t beyond = accuracy->num_beyond_objective;
    row.push_back(figure_cell(accuracy->worst, scale));
    row.push_back(count_cell(accuracy->worst_run.value, Tone::plain));
    row.push_back(figure_cell(accuracy->mean, scale));
    row.push_back(num_runs < 2 ? no_figure() : figure_cell(accuracy->standard_deviation, scale));
    row.push_back(std::isfinite(objective)
                      ? count_cell(beyond, beyond > 0 ? Tone::bad : Tone::plain)
                      : no_figure());
  }
  return row;
}

void add_triple(double value, const std::optional<Interval>& interval, double scale, Row& row) {
  row.push_back(figure_cell(value, scale));
  add_ends(not_negative(interval), scale, row);
}

Cell skewness_cell(const AccuracyStatistic& accuracy, std::uint64_t num_runs) {
  if (num_runs < 3) return no_figure();
  Cell cell = figure_cell(accuracy.error.skewness);
  cell.text = fmt::format("{:.2f}", accuracy.error.skewness);
  return cell;
}

Row interval_row(const Quantity& quantity, const AccuracyStatistic& accuracy,
                 std::uint64_t num_runs) {
  const double scale = quantity.display_scale;
  Row row{quantity.symbol};
  add_triple(accuracy.mean, accuracy.mean_interval, scale, row);
  if (num_runs < 2) {
    row.insert(row.end(), 3, no_figure());
  } else {
    // Values that differ have a deviation: an end of 0 is that of resamples without the far ones.
    const bool is_known = !accuracy.deviation_interval || accuracy.standard_deviation == 0.0 ||
                          accuracy.deviation_interval->lower > 0.0;
    add_triple(accuracy.standard_deviation, is_known ? accuracy.deviation_interval : std::nullopt,
               scale, row);
  }
  row.push_back(figure_cell(accuracy.error.bias, scale));
  row.push_back(skewness_cell(accuracy, num_runs));
  return row;
}

/// Fewest runs from which on the bootstrap covers what it says; core/statistics/README.md.
constexpr std::uint64_t num_runs_of_bootstrap = 200;

/// What "the worst of n" is worth [Wilks1941].
std::string worth_of_worst(std::uint64_t num_runs, std::uint64_t num_without_estimate) {
  const double coverage = std::pow(1.0 - default_confidence, 1.0 / static_cast<double>(num_runs));
  // Rounded down: no more is claimed than holds.
  std::string text =
      fmt::format("worst of {}: with 95 % confidence {} % of all draws are no larger", num_runs,
                  std::floor(coverage * 1e5) / 1e3);
  if (num_without_estimate > 0) {
    text += fmt::format(", of those that have an estimate; {} more {} none", num_without_estimate,
                        num_without_estimate == 1 ? "has" : "have");
  }
  return text + " (one parameter by itself, not all together)";
}

/// That chance alone makes such a bias, by Student's law.
/// @pre num_runs ≥ 2
double bias_p_value(const ErrorStatistic& error, std::uint64_t num_runs) {
  if (error.bias == 0.0) return 1.0;
  if (error.standard_deviation <= 0.0) return 0.0;
  const auto n = static_cast<double>(num_runs);
  return student_two_sided(error.bias * std::sqrt(n) / error.standard_deviation, n - 1.0);
}

/// Student's law holds for the mean of n values if their skewness is √n/5 or less [Cochran1977].
/// Chance makes that of a sample larger by two standard deviations, 2√(6/n).
bool is_too_skewed(double skewness, std::uint64_t num_runs) {
  const auto n = static_cast<double>(num_runs);
  return std::abs(skewness) > std::sqrt(n) / 5.0 + 2.0 * std::sqrt(6.0 / n);
}

/// `a, b`, the symbols of those parameters of which is_one(index) holds.
template <typename IsOne>
std::string symbols_of(const Review& review, const IsOne& is_one) {
  std::string list;
  for (std::size_t i = 0; i < review.schema.quantities.size(); ++i) {
    if (!is_one(i)) continue;
    list += fmt::format("{}{}", list.empty() ? "" : ", ", review.schema.quantities[i].symbol);
  }
  return list;
}

/// Which biases differ from 0, and which intervals do not hold.
std::string bias_sentence(const Review& review) {
  const CampaignStatistics& statistics = review.results.statistics;
  const std::uint64_t num_runs = statistics.num_estimated;
  if (num_runs < 2) return "Bias: one run does not tell whether it differs from 0.";
  const std::string skewed = symbols_of(review, [&](std::size_t i) {
    return is_too_skewed(statistics.accuracy[i].error.skewness, num_runs);
  });
  const std::string names = symbols_of(review, [&](std::size_t i) { return is_biased(review, i); });
  const std::size_t count = statistics.accuracy.size();
  return fmt::format(
      "Bias: each interval holds by itself{}. {} {}.",
      skewed.empty() ? ""
                     : fmt::format(", but not of errors that are too skewed for {} runs: {}",
                                   num_runs, skewed),
      count == 1 ? "At 5 %" : fmt::format("Of all {} together (Holm, 5 %)", count),
      names.empty() ? fmt::format("no {}bias differs from 0", skewed.empty() ? "" : "other ")
                    : "the bias differs from 0 of " + names);
}

/// Where the intervals of |error| cover less than they say; empty if nowhere.
std::string skewness_note(const Review& review) {
  const CampaignStatistics& statistics = review.results.statistics;
  const std::string skewed = symbols_of(review, [&](std::size_t i) {
    return is_too_skewed(statistics.accuracy[i].skewness, statistics.num_estimated);
  });
  if (skewed.empty()) return "";
  return fmt::format(
      "mean, std: too skewed for intervals from {} runs, which may cover less than 95 %: {}",
      statistics.num_estimated, skewed);
}

std::string joint_sentence(const Review& review) {
  const CampaignStatistics& statistics = review.results.statistics;
  const std::uint64_t num_given_up = review.results.missing.num_given_up;
  const std::string seen =
      fmt::format("all objectives together: {} of {} runs", statistics.num_within_objectives,
                  statistics.num_runs + num_given_up);
  const std::optional<Interval> share = statistics.within_objectives(num_given_up);
  if (!share) return seen;
  return fmt::format("{}, {} of all draws ({})", seen, interval_percent(*share),
                     name_of(review.interpretation));
}

/// What the level of a budget is, and that it is the one of the runs or an assumed one.
std::string level_sentence(const Review& review) {
  const ErrorBudget& budget = *review.budget;
  const CampaignStatistics& statistics = review.results.statistics;
  const std::string_view unit = review.schema.health.at(review.schema.budget_level).unit;
  const bool is_told = budget.level < statistics.health.size();
  const HealthStatistic level = is_told ? statistics.health[budget.level] : HealthStatistic{};
  if (level.worst == 0.0) {
    return fmt::format("{} is assumed: {:.3g} {}", budget.level_label, budget.assumed_level, unit);
  }
  return fmt::format("{} is that of the runs: worst {:.3g}, mean {:.3g} {}; assumed was {:.3g}",
                     budget.level_label, level.worst, level.mean, unit, budget.assumed_level);
}

/// What error_table() shows of a quantity.
Row error_row(const Quantity& quantity, double objective, const AccuracyStatistic& accuracy,
              const Review& review) {
  const double scale = quantity.display_scale;
  const bool has_intervals = review.why_not_independent.empty();
  Row row{quantity.symbol};
  if (has_intervals) {
    add_ends(accuracy.error.bias_interval, scale, row);
  } else {
    row.push_back(figure_cell(accuracy.error.bias, scale));
    row.push_back(skewness_cell(accuracy, review.results.statistics.num_estimated));
  }
  for (const PercentileStatistic& percentile : accuracy.percentiles) {
    row.push_back(figure_cell(percentile.value, scale));
  }
  if (!has_intervals) return row;
  for (const double share : {accuracy.beyond_objective.lower, accuracy.beyond_objective.upper}) {
    row.push_back(std::isfinite(objective) ? figure_cell(share, 0.01) : no_figure());
  }
  return row;
}

// Published totals, too, add up the worst errors of all parameters, which no single run has.
std::string totals_sentence(const RunTotals& totals) {
  return fmt::format(
      "worst adds up the worst errors of different runs, as the paper does; totals of single runs "
      "that have an estimate: median {:.1e}, 95 % below {:.1e}, worst {:.1e} (run {})",
      totals.median, totals.percentile_95, totals.worst, totals.worst_run.value);
}

std::vector<std::string> budget_notes(const Review& review) {
  std::vector<std::string> notes{
      "before: bounds of construction; worst, mean: left by errors of the estimates",
      level_sentence(review)};
  std::istringstream lines(review.budget->note);
  for (std::string line; std::getline(lines, line);) notes.push_back(line);
  if (const auto& totals = review.results.totals) notes.push_back(totals_sentence(*totals));
  return notes;
}

}  // namespace

bool is_biased(const Review& review, std::size_t quantity) {
  const CampaignStatistics& statistics = review.results.statistics;
  const std::uint64_t num_runs = statistics.num_estimated;
  if (num_runs < 2 || !statistics.are_draws_independent ||
      is_too_skewed(statistics.accuracy[quantity].error.skewness, num_runs)) {
    return false;
  }
  std::vector<double> p_values;
  for (const AccuracyStatistic& accuracy : statistics.accuracy) {
    p_values.push_back(bias_p_value(accuracy.error, num_runs));
  }
  return holm_adjusted(p_values)[quantity] < 1.0 - default_confidence;
}

Cell figure_cell(const std::optional<double>& value, double scale) {
  if (!value) return no_figure();
  Cell cell(signed_figure(*value / scale), *value);
  cell.document = figure_text(*value / scale);
  return cell;
}

Cell no_figure() {
  Cell cell("-");
  cell.document = "–";
  return cell;
}

std::optional<Interval> not_negative(std::optional<Interval> interval) {
  if (interval) interval->lower = std::fmax(interval->lower, 0.0);
  return interval;
}

void add_ends(const std::optional<Interval>& interval, double scale, Row& row) {
  for (const double Interval::*end : {&Interval::lower, &Interval::upper}) {
    row.push_back(interval ? figure_cell((*interval).*end, scale) : no_figure());
  }
}

Cell unit_cell(const Quantity& quantity) {
  Cell cell(quantity.display_unit);
  cell.document = unit_text(quantity.display_unit);
  return cell;
}

Table accuracy_table(const Review& review) {
  const ResultSchema& schema = review.schema;
  const CampaignStatistics& statistics = review.results.statistics;
  Table table{.id = "accuracy",
              .caption = fmt::format("Accuracy of the estimates: |estimate − truth| of {}",
                                     counted(statistics.num_estimated, "run")),
              .columns = {{"parameter", true, 11},
                          {"unit", true, 9},
                          {"objective", false, 9},
                          {"worst", false, 8, ours},
                          {"in run", false, 8, ours, false, true},
                          {"mean", false, 8, ours},
                          {"std", false, 8, ours},
                          {"beyond", false, 8, ours}},
              .notes = {"beyond: runs whose error exceeds the objective"}};
  const bool has_published = std::ranges::any_of(
      schema.quantities, [](const Quantity& quantity) { return quantity.published.has_value(); });
  if (has_published) {
    table.columns.insert(
        table.columns.end(),
        {{"worst", false, 6, theirs, true}, {"mean", false, 6, theirs}, {"std", false, 6, theirs}});
  }
  for (std::size_t i = 0; i < review.objectives.size(); ++i) {
    table.rows.push_back(
        accuracy_row(schema.quantities[i], review.objectives[i],
                     statistics.num_estimated > 0 ? &statistics.accuracy[i] : nullptr,
                     statistics.num_estimated));
    if (has_published) add_published(schema.quantities[i], table.rows.back());
  }
  if (!schema.published_source.empty()) {
    table.notes.back() += fmt::format("; {}: {}", theirs, schema.published_source);
  }
  return table;
}

Table interval_table(const Review& review) {
  const CampaignStatistics& statistics = review.results.statistics;
  if (statistics.num_estimated == 0 || !statistics.are_draws_independent) return {};
  constexpr const char* mean = "mean of |error|";
  constexpr const char* deviation = "std of |error|";
  Table table{.id = "interval-table",
              .caption = "95 % intervals, in the units above",
              .columns = {{"parameter", true, 11},
                          {"mean", false, 8, mean},
                          {"from", false, 8, mean},
                          {"to", false, 9, mean},
                          {"std", false, 8, deviation, true},
                          {"from", false, 8, deviation},
                          {"to", false, 9, deviation},
                          {"bias", false, 9, "error", true},
                          {"skew", false, 7, "error"}}};
  for (std::size_t i = 0; i < statistics.accuracy.size(); ++i) {
    table.rows.push_back(interval_row(review.schema.quantities[i], statistics.accuracy[i],
                                      statistics.num_estimated));
  }
  if (statistics.num_estimated < num_runs_of_bootstrap &&
      std::ranges::any_of(statistics.accuracy, [](const AccuracyStatistic& accuracy) {
        return accuracy.deviation_interval.has_value();
      })) {
    table.notes.emplace_back(
        "std: an interval from fewer than 200 runs is too narrow, see core/statistics");
  }
  if (std::string note = skewness_note(review); !note.empty()) table.notes.push_back(note);
  // Whoever stops where the errors are small sees a worst one that is too small.
  if (!review.stop) {
    table.notes.push_back(worth_of_worst(
        statistics.num_estimated,
        statistics.num_runs - statistics.num_estimated + review.results.missing.num_given_up));
  }
  return table;
}

Table error_table(const Review& review) {
  const CampaignStatistics& statistics = review.results.statistics;
  if (statistics.num_estimated == 0) return {};
  constexpr const char* percentiles = "percentiles of |error|";
  constexpr const char* beyond = "beyond, %";
  static_assert(percentile_levels == std::array{0.5, 0.9, 0.95, 0.99});
  const bool has_intervals = review.why_not_independent.empty();
  Table table{.id = "error-table",
              .caption = has_intervals ? "95 % intervals of bias and of draws beyond the objective"
                                       : "Errors, in the units above",
              .columns = {{"parameter", true, 10}}};
  const auto add = [&](std::initializer_list<Column> columns) {
    table.columns.insert(table.columns.end(), columns);
  };
  if (has_intervals) add({{"from", false, 9, "bias"}, {"to", false, 10, "bias"}});
  if (!has_intervals) add({{"bias", false, 9}, {"skew", false, 8}});
  add({{"50 %", false, 8, percentiles, true},
       {"90 %", false, 8, percentiles},
       {"95 %", false, 8, percentiles},
       {"99 %", false, 9, percentiles}});
  if (has_intervals) add({{"from", false, 7, beyond, true}, {"to", false, 8, beyond}});
  for (std::size_t i = 0; i < statistics.accuracy.size(); ++i) {
    table.rows.push_back(error_row(review.schema.quantities[i], review.objectives[i],
                                   statistics.accuracy[i], review));
  }
  table.notes.push_back(has_intervals ? bias_sentence(review)
                                      : "no intervals over runs: " + review.why_not_independent);
  const bool has_objective = std::ranges::any_of(
      review.objectives, [](double objective) { return std::isfinite(objective); });
  const std::uint64_t num_draws = statistics.num_runs + review.results.missing.num_given_up;
  if (has_intervals && has_objective && statistics.num_estimated < num_draws) {
    table.notes.push_back(fmt::format(
        "beyond: of draws that have an estimate; {} of {} have none and meet no objective",
        num_draws - statistics.num_estimated, num_draws));
  }
  if (has_objective || !has_intervals) table.notes.push_back(joint_sentence(review));
  return table;
}

std::vector<Table> accuracy_tables(const Review& review) {
  return {accuracy_table(review), interval_table(review), error_table(review)};
}

std::vector<Table> group_tables(const Review& review) {
  const ResultSchema& schema = review.schema;
  const ReadResults& results = review.results;
  if (results.replicates) return {replicate_table(schema, *results.replicates)};
  if (!results.instruments) return {};
  return {variance_table(schema, *results.instruments),
          instrument_table(schema, *results.instruments)};
}

Table budget_table(const Review& review) {
  if (!review.budget) return {};
  const ErrorBudget& budget = *review.budget;
  Table table{.id = "budget-table",
              .caption = std::string(budget.title),
              .columns = {{"term", true, 23},
                          {"before", false, 9, ours},
                          {"worst", false, 9, ours},
                          {"mean", false, 10, ours},
                          {"before", false, 9, theirs, true},
                          {"worst", false, 9, theirs},
                          {"mean", false, 9, theirs}},
              .has_total = true,
              .notes = budget_notes(review)};
  const auto figure = [](double value) {
    Cell cell = figure_cell(value);
    cell.text = fmt::format("{:.1e}", value);
    return cell;
  };
  const BudgetColumns columns = budget_columns(budget, review.results.statistics);
  const auto add = [&](const BudgetEntryInfo& info, const auto& value_of) {
    Row row{info.label, figure(value_of(columns.before))};
    for (const auto& after : {columns.after_worst, columns.after_mean}) {
      row.push_back(after ? figure(value_of(*after)) : no_figure());
    }
    for (const double value : {info.paper_before, info.paper_after_worst, info.paper_after_mean}) {
      row.push_back(figure(value));
    }
    table.rows.push_back(std::move(row));
  };
  for (std::size_t i = 0; i < budget.terms.size(); ++i) {
    add(budget.terms[i].info, [&](const Budget& of) { return of.entries[i]; });
  }
  add(budget.total_info, [](const Budget& of) { return of.total; });
  return table;
}

}  // namespace proofmass::coordinator
