#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "coordinator/charts/chart.hpp"
#include "coordinator/report/report.hpp"
#include "coordinator/report/requirements.hpp"
#include "coordinator/table/table.hpp"
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
  cell.document = figure_text(value / scale, 6);
  return cell;
}

Cell count_cell(std::uint64_t count, Tone tone) {
  const auto value = static_cast<double>(count);
  Cell cell(count < 1'000'000 ? std::to_string(count) : measured_figure(value), tone);
  cell.value = value;
  cell.document = std::to_string(count);
  return cell;
}

Cell skewness_cell(const AccuracyStatistic& accuracy, std::uint64_t num_runs) {
  if (num_runs < 3) return no_figure();
  Cell cell = figure_cell(accuracy.error.skewness);
  cell.text = fmt::format("{:.2f}", accuracy.error.skewness);
  return cell;
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

/// Fewest runs that a bias is judged by. What is rare, or skew, shows in fewer of them too seldom
/// for is_too_skewed(): 3 errors of a lognormal law with σ = 2 would differ from their mean in 46 %
/// of campaigns.
constexpr std::uint64_t bias_runs_min = 20;

/// That chance alone makes such a bias, by Student's law.
double bias_p_value(const ErrorStatistic& error, std::uint64_t num_runs) {
  if (error.bias == 0.0) return 1.0;
  if (error.standard_deviation <= 0.0) return 0.0;
  const auto n = static_cast<double>(num_runs);
  return student_two_sided(error.bias * std::sqrt(n) / error.standard_deviation, n - 1.0);
}

/// Said behind what holds for a number of runs that was fixed before the first of them.
std::string unfixed_text(const Review& review) {
  const std::uint64_t num_runs =
      review.results.statistics.num_runs + review.results.missing.num_given_up;
  if (review.num_runs_fixed == num_runs) return "";
  return fmt::format(", and for a number of runs fixed beforehand, which {} was not", num_runs);
}

/// Which biases differ from 0, and which intervals do not hold.
std::string bias_sentence(const Review& review) {
  const CampaignStatistics& statistics = review.results.statistics;
  const std::uint64_t num_runs = statistics.num_estimated;
  if (num_runs < bias_runs_min) {
    return fmt::format("Bias: fewer than {} runs do not tell whether it differs from 0.",
                       bias_runs_min);
  }
  const std::string skewed = symbols_of(review.schema, [&](std::size_t i) {
    return is_too_skewed(statistics.accuracy[i].error.skewness, num_runs);
  });
  const std::string names =
      symbols_of(review.schema, [&](std::size_t i) { return is_biased(review, i); });
  const std::size_t count = statistics.accuracy.size();
  return fmt::format(
      "Bias: each interval holds by itself{}{}. {} {}.", unfixed_text(review),
      skewed.empty() ? ""
                     : fmt::format(", but not of errors that are too skewed for {} runs: {}",
                                   num_runs, skewed),
      count == 1 ? "At 5 %" : fmt::format("Of all {} together (Holm, 5 %)", count),
      names.empty()
          ? fmt::format("no {}bias is found to differ from 0", skewed.empty() ? "" : "other ")
          : "the bias differs from 0 of " + names);
}

/// Where the intervals of |error| cover less than they say; empty if nowhere.
std::string skewness_note(const Review& review) {
  const CampaignStatistics& statistics = review.results.statistics;
  const std::string skewed = symbols_of(review.schema, [&](std::size_t i) {
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

/// Of which runs the level of a budget is, as level_notes() takes it.
std::string told_level(const Review& review) {
  const CampaignStatistics& statistics = review.results.statistics;
  const std::size_t of_budget = review.budget->level;
  if (of_budget >= statistics.health.size()) return {};
  const HealthStatistic& level = statistics.health[of_budget];
  if (level.worst == 0.0) return {};
  return fmt::format("the runs: worst {:.3g}, mean {:.3g}", level.worst, level.mean);
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
      "before: bounds of construction; worst, mean: left by errors of the estimates"};
  const std::string_view unit = review.schema.health.at(review.schema.budget_level).unit;
  for (std::string& note : level_notes(*review.budget, unit, told_level(review))) {
    notes.push_back(std::move(note));
  }
  if (const auto& totals = review.results.totals) notes.push_back(totals_sentence(*totals));
  return notes;
}

}  // namespace

std::vector<std::string> level_notes(const ErrorBudget& budget, std::string_view unit,
                                     std::string_view told) {
  std::vector<std::string> notes{
      told.empty()
          ? fmt::format("{} is assumed: {:.3g} {}", budget.level_label, budget.assumed_level, unit)
          : fmt::format("{} is that of {} {}; assumed was {:.3g}", budget.level_label, told, unit,
                        budget.assumed_level)};
  std::istringstream lines(budget.note);
  for (std::string line; std::getline(lines, line);) notes.push_back(line);
  return notes;
}

bool is_biased(const Review& review, std::size_t quantity) {
  const CampaignStatistics& statistics = review.results.statistics;
  const std::uint64_t num_runs = statistics.num_estimated;
  if (num_runs < bias_runs_min || !statistics.are_draws_independent ||
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
  cell.document = measured_text(*value / scale);
  return cell;
}

Cell no_figure() {
  Cell cell("-");
  cell.document = "–";
  return cell;
}

std::string symbols_of(const ResultSchema& schema, const std::function<bool(std::size_t)>& is_one) {
  std::string list;
  for (std::size_t i = 0; i < schema.quantities.size(); ++i) {
    if (!is_one(i)) continue;
    list += fmt::format("{}{}", list.empty() ? "" : ", ", schema.quantities[i].symbol);
  }
  return list;
}

std::optional<Interval> not_negative(std::optional<Interval> interval) {
  if (interval) interval->lower = std::fmax(interval->lower, 0.0);
  return interval;
}

void add_column(Table& table, Column column,
                const std::function<Cell(std::size_t row)>& cell_of_row) {
  table.columns.push_back(std::move(column));
  for (std::size_t i = 0; i < table.rows.size(); ++i) table.rows[i].push_back(cell_of_row(i));
}

void add_ends(Table& table, Column from, Column to,
              const std::function<IntervalAndScale(std::size_t row)>& of_row) {
  const auto add = [&](Column& column, double Interval::*end) {
    add_column(table, std::move(column), [&](std::size_t i) {
      const auto [interval, scale] = of_row(i);
      return interval ? figure_cell((*interval).*end, scale) : no_figure();
    });
  };
  add(from, &Interval::lower);
  add(to, &Interval::upper);
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
              .rows = std::vector<Row>(review.objectives.size()),
              .notes = {"beyond: runs whose error exceeds the objective"}};
  const auto scale = [&](std::size_t i) { return schema.quantities[i].display_scale; };
  const auto has_objective = [&](std::size_t i) { return std::isfinite(review.objectives[i]); };
  const auto add_of_runs = [&](Column column, const auto& cell_of) {
    add_column(table, std::move(column), [&](std::size_t i) {
      return statistics.num_estimated > 0 ? cell_of(statistics.accuracy[i], i) : no_figure();
    });
  };
  add_column(table, {"parameter", true, 11}, [&](auto i) { return schema.quantities[i].symbol; });
  add_column(table, {"unit", true, 9}, [&](auto i) { return unit_cell(schema.quantities[i]); });
  add_column(table, {"objective", false, 9}, [&](std::size_t i) {
    return has_objective(i) ? given_cell(review.objectives[i], scale(i)) : no_figure();
  });
  add_of_runs({"worst", false, 8, ours},
              [&](const auto& of, auto i) { return figure_cell(of.worst, scale(i)); });
  add_of_runs({"in run", false, 8, ours, false, true},
              [&](const auto& of, auto) { return count_cell(of.worst_run.value, Tone::plain); });
  add_of_runs({"mean", false, 8, ours},
              [&](const auto& of, auto i) { return figure_cell(of.mean, scale(i)); });
  add_of_runs({"std", false, 8, ours}, [&](const auto& of, auto i) {
    return statistics.num_estimated < 2 ? no_figure()
                                        : figure_cell(of.standard_deviation, scale(i));
  });
  add_of_runs({"beyond", false, 8, ours}, [&](const auto& of, auto i) {
    const std::uint64_t beyond = of.num_beyond_objective;
    return has_objective(i) ? count_cell(beyond, beyond > 0 ? Tone::bad : Tone::plain)
                            : no_figure();
  });
  const auto add_published = [&](Column column, double PublishedAccuracy::*figure) {
    add_column(table, std::move(column), [&](std::size_t i) {
      const auto& published = schema.quantities[i].published;
      return published ? given_cell((*published).*figure, scale(i)) : Cell("");
    });
  };
  if (std::ranges::any_of(schema.quantities,
                          [](const Quantity& of) { return of.published.has_value(); })) {
    add_published({"worst", false, 6, theirs, true}, &PublishedAccuracy::worst);
    add_published({"mean", false, 6, theirs}, &PublishedAccuracy::mean);
    add_published({"std", false, 6, theirs}, &PublishedAccuracy::standard_deviation);
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
  const std::vector<AccuracyStatistic>& all = statistics.accuracy;
  const bool has_deviation = statistics.num_estimated > 1;
  const auto scale = [&](std::size_t i) { return review.schema.quantities[i].display_scale; };
  Table table{.id = "interval-table",
              .caption = "95 % intervals, in the units above",
              .rows = std::vector<Row>(all.size())};
  add_column(table, {"parameter", true, 11},
             [&](auto i) { return review.schema.quantities[i].symbol; });
  add_column(table, {"mean", false, 8, mean},
             [&](auto i) { return figure_cell(all[i].mean, scale(i)); });
  add_ends(table, {"from", false, 8, mean}, {"to", false, 9, mean},
           [&](auto i) { return IntervalAndScale(not_negative(all[i].mean_interval), scale(i)); });
  add_column(table, {"std", false, 8, deviation, true}, [&](auto i) {
    return has_deviation ? figure_cell(all[i].standard_deviation, scale(i)) : no_figure();
  });
  add_ends(table, {"from", false, 8, deviation}, {"to", false, 9, deviation},
           [&](auto i) { return IntervalAndScale(all[i].deviation_interval, scale(i)); });
  add_column(table, {"bias", false, 9, "error", true},
             [&](auto i) { return figure_cell(all[i].error.bias, scale(i)); });
  add_column(table, {"skew", false, 7, "error"},
             [&](auto i) { return skewness_cell(all[i], statistics.num_estimated); });
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
    const std::uint64_t num_without_estimate =
        statistics.num_runs - statistics.num_estimated + review.results.missing.num_given_up;
    table.notes.push_back(worth_of_worst(statistics.num_estimated, num_without_estimate) +
                          unfixed_text(review));
  }
  return table;
}

Table error_table(const Review& review) {
  const CampaignStatistics& statistics = review.results.statistics;
  if (statistics.num_estimated == 0) return {};
  constexpr const char* percentiles = "percentiles of |error|";
  constexpr const char* beyond = "beyond, %";
  const bool has_intervals = review.why_not_independent.empty();
  Table table{.id = "error-table",
              .caption = has_intervals ? "95 % intervals of bias and of draws beyond the objective"
                                       : "Errors, in the units above",
              .rows = std::vector<Row>(statistics.accuracy.size())};
  const std::vector<AccuracyStatistic>& all = statistics.accuracy;
  const auto scale = [&](std::size_t i) { return review.schema.quantities[i].display_scale; };
  add_column(table, {"parameter", true, 10},
             [&](auto i) { return review.schema.quantities[i].symbol; });
  if (has_intervals) {
    add_ends(table, {"from", false, 9, "bias"}, {"to", false, 10, "bias"},
             [&](auto i) { return IntervalAndScale(all[i].error.bias_interval, scale(i)); });
  } else {
    add_column(table, {"bias", false, 9},
               [&](auto i) { return figure_cell(all[i].error.bias, scale(i)); });
    add_column(table, {"skew", false, 8},
               [&](auto i) { return skewness_cell(all[i], statistics.num_estimated); });
  }
  for (std::size_t k = 0; k < percentile_levels.size(); ++k) {
    const bool is_last = k + 1 == percentile_levels.size();
    add_column(table,
               {fmt::format("{:.0f} %", 100.0 * percentile_levels[k]), false, is_last ? 9U : 8U,
                percentiles, k == 0},
               [&](auto i) { return figure_cell(all[i].percentiles[k].value, scale(i)); });
  }
  if (has_intervals) {
    add_ends(table, {"from", false, 7, beyond, true}, {"to", false, 8, beyond}, [&](auto i) {
      const bool has_objective = std::isfinite(review.objectives[i]);
      return IntervalAndScale(has_objective ? std::optional(all[i].beyond_objective) : std::nullopt,
                              percent_scale);
    });
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
