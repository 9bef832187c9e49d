#include "coordinator/report/review_tables.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "coordinator/charts/ticks.hpp"
#include "coordinator/report/report.hpp"
#include "coordinator/report/requirements.hpp"
#include "core/model.hpp"
#include "proto/link/start_program.hpp"

namespace proofmass::coordinator {
namespace {

using Kind = ReviewCell::Kind;

ReviewCell heading_cell(std::string_view text) {
  return {.text = std::string(text), .kind = Kind::words};
}

ReviewCell no_figure() { return {.text = "–"}; }

ReviewCell figure_cell(double value) { return {.text = figure_text(value), .value = value}; }

ReviewCell scaled_cell(double value, double scale) {
  return {.text = figure_text(value / scale), .value = value};
}

void add_interval_cells(const std::optional<Interval>& interval, double scale, double least,
                        std::vector<ReviewCell>& cells) {
  if (!interval) {
    cells.insert(cells.end(), 2, no_figure());
    return;
  }
  cells.push_back(scaled_cell(std::max(interval->lower, least), scale));
  cells.push_back(scaled_cell(interval->upper, scale));
}

std::vector<ReviewCell> accuracy_cells(const Review& review, std::size_t index) {
  const Quantity& quantity = model().results().quantities[index];
  const CampaignStatistics& statistics = review.results.statistics;
  const double scale = quantity.display_scale;
  const double objective = review.objectives[index];
  std::vector<ReviewCell> cells{heading_cell(quantity.symbol),
                                heading_cell(unit_text(quantity.display_unit))};
  cells.push_back(std::isfinite(objective) ? scaled_cell(objective, scale) : no_figure());
  if (statistics.num_estimated == 0) {
    cells.insert(cells.end(), 5, no_figure());
  } else {
    const AccuracyStatistic& accuracy = statistics.accuracy[index];
    cells.push_back(scaled_cell(accuracy.worst, scale));
    cells.push_back({.text = std::to_string(accuracy.worst_run.value),
                     .value = static_cast<double>(accuracy.worst_run.value)});
    cells.push_back(scaled_cell(accuracy.mean, scale));
    cells.push_back(statistics.num_estimated < 2 ? no_figure()
                                                 : scaled_cell(accuracy.standard_deviation, scale));
    cells.push_back({.text = std::to_string(accuracy.num_beyond_objective),
                     .value = static_cast<double>(accuracy.num_beyond_objective)});
  }
  for (const double PublishedAccuracy::*figure :
       {&PublishedAccuracy::worst, &PublishedAccuracy::mean,
        &PublishedAccuracy::standard_deviation}) {
    cells.push_back(quantity.published ? scaled_cell((*quantity.published).*figure, scale)
                                       : no_figure());
  }
  return cells;
}

std::vector<ReviewCell> inference_cells(const Review& review, std::size_t index) {
  const Quantity& quantity = model().results().quantities[index];
  const AccuracyStatistic& accuracy = review.results.statistics.accuracy[index];
  const double scale = quantity.display_scale;
  std::vector<ReviewCell> cells{heading_cell(quantity.symbol),
                                heading_cell(unit_text(quantity.display_unit))};
  add_interval_cells(accuracy.mean_interval, scale, 0.0, cells);
  add_interval_cells(accuracy.deviation_interval, scale, 0.0, cells);
  add_interval_cells(accuracy.error.bias_interval, scale, -magnitude_max, cells);
  for (const PercentileStatistic& percentile : accuracy.percentiles) {
    cells.push_back(scaled_cell(percentile.value, scale));
  }
  const Interval& beyond = accuracy.beyond_objective;
  for (const double share : {beyond.lower, beyond.upper}) {
    const bool is_known = beyond.upper - beyond.lower < 1.0;
    cells.push_back(is_known ? scaled_cell(share, 0.01) : no_figure());
  }
  return cells;
}

std::string joint_sentence(const Review& review) {
  const CampaignStatistics& statistics = review.results.statistics;
  const auto interval = statistics.within_objectives(review.num_given_up);
  if (!interval) return "";
  return fmt::format("All objectives hold together in {} of {} draws: {} of all draws ({}, 95 %).",
                     statistics.num_within_objectives, statistics.num_runs + review.num_given_up,
                     interval_percent(*interval), name_of(review.interpretation));
}

std::vector<ReviewCell> pair_of(std::string_view name, std::string text) {
  return {heading_cell(name), {.text = std::move(text), .kind = Kind::words}};
}

std::string digest_words(const Review& review) {
  return review.digest_check == DigestCheck::holds
             ? review.results.digests.results + " (equal to the stored one)"
             : review.results.digests.results +
                   " (not checked: there is no stored one of these runs)";
}

std::string hours(double seconds) { return figure_text(seconds / 3600.0) + " h"; }

}  // namespace

std::string quantity_text(double value, const Quantity& quantity) {
  const std::string figure = figure_text(value / quantity.display_scale);
  if (quantity.display_unit == "1") return figure;
  const std::string unit = unit_text(quantity.display_unit);
  if (!unit.starts_with("10")) return figure + " " + unit;
  const bool has_power = figure.find("×10") != std::string::npos || figure.starts_with("10⁻");
  return has_power ? figure_text(value) + unit.substr(std::min(unit.find(' '), unit.size()))
                   : figure + "×" + unit;
}

std::string name_in_symbols(std::string_view name) {
  const std::vector<Quantity>& quantities = model().results().quantities;
  const auto found = std::ranges::find(quantities, name, &Quantity::name);
  return std::string(found == quantities.end() ? name : found->symbol);
}

ReviewTable review_accuracy_table(const Review& review) {
  const std::string ours = "this campaign";
  const std::string theirs = "published";
  ReviewTable table{.id = "accuracy",
                    .caption = fmt::format("|estimate − truth| of {} runs",
                                           review.results.statistics.num_estimated),
                    .columns = {{.title = "parameter", .is_text = true},
                                {.title = "unit", .is_text = true},
                                {.title = "objective"},
                                {.title = "worst", .group = ours},
                                {.title = "in run", .group = ours},
                                {.title = "mean", .group = ours},
                                {.title = "std", .group = ours},
                                {.title = "beyond", .group = ours},
                                {.title = "worst", .group = theirs},
                                {.title = "mean", .group = theirs},
                                {.title = "std", .group = theirs}},
                    .rows = {},
                    .notes = {"Beyond: runs whose |error| exceeds the objective."}};
  for (std::size_t i = 0; i < review.objectives.size(); ++i) {
    table.rows.push_back(accuracy_cells(review, i));
  }
  return table;
}

ReviewTable inference_table(const Review& review) {
  const std::string mean = "mean |error|, 95 %";
  const std::string deviation = "std of |error|, 95 %";
  const std::string bias = "bias, 95 %";
  const std::string_view interpretation = name_of(review.interpretation);
  const std::string levels = fmt::format("percentiles of |error| ({})", interpretation);
  const std::string beyond = fmt::format("beyond, % of all draws ({}, 95 %)", interpretation);
  ReviewTable table{.id = "inference",
                    .caption = "What these draws say about all draws",
                    .columns = {{.title = "parameter", .is_text = true},
                                {.title = "unit", .is_text = true},
                                {.title = "from", .group = mean},
                                {.title = "to", .group = mean},
                                {.title = "from", .group = deviation},
                                {.title = "to", .group = deviation},
                                {.title = "from", .group = bias},
                                {.title = "to", .group = bias},
                                {.title = "50 %", .group = levels},
                                {.title = "90 %", .group = levels},
                                {.title = "95 %", .group = levels},
                                {.title = "99 %", .group = levels},
                                {.title = "from", .group = beyond},
                                {.title = "to", .group = beyond}},
                    .rows = {},
                    .notes = {joint_sentence(review)}};
  if (review.results.statistics.num_estimated == 0) return table;
  table.notes.push_back(
      review.why_not_independent.empty()
          ? bias_sentence(review.results.statistics)
          : fmt::format("No intervals and no verdicts: {}.", review.why_not_independent));
  for (std::size_t i = 0; i < review.objectives.size(); ++i) {
    table.rows.push_back(inference_cells(review, i));
  }
  return table;
}

ReviewTable review_budget_table(const Review& review) {
  const std::string ours = "this campaign";
  const std::string theirs = "published";
  ReviewTable table{.id = "budget-table",
                    .caption = "",
                    .columns = {{.title = "term", .is_text = true},
                                {.title = "before", .group = ours},
                                {.title = "after, worst", .group = ours},
                                {.title = "after, mean", .group = ours},
                                {.title = "before", .group = theirs},
                                {.title = "after, worst", .group = theirs},
                                {.title = "after, mean", .group = theirs}},
                    .rows = {},
                    .notes = {}};
  if (!review.budget) return table;
  const ErrorBudget& budget = *review.budget;
  table.caption = std::string(budget.title);
  const BudgetColumns columns = budget_columns(budget, review.results.statistics);
  const auto add = [&](const BudgetEntryInfo& info, const auto& value_of) {
    std::vector<ReviewCell> cells{heading_cell(info.label), figure_cell(value_of(columns.before))};
    for (const auto& after : {columns.after_worst, columns.after_mean}) {
      cells.push_back(after ? figure_cell(value_of(*after)) : no_figure());
    }
    for (const double figure : {info.paper_before, info.paper_after_worst, info.paper_after_mean}) {
      cells.push_back(figure_cell(figure));
    }
    table.rows.push_back(std::move(cells));
  };
  for (std::size_t i = 0; i < budget.terms.size(); ++i) {
    add(budget.terms[i].info, [&](const Budget& of) { return of.entries[i]; });
  }
  add(budget.total_info, [](const Budget& of) { return of.total; });
  table.notes.emplace_back(
      "Before: bounds of construction. After: what the errors of the estimates leave; the worst "
      "adds up the worst errors of different runs.");
  table.notes.push_back(level_text(budget, review.results.statistics, figure_text) + ".");
  if (!budget.note.empty()) table.notes.push_back(budget.note);
  if (const std::optional<RunTotals>& totals = review.results.totals) {
    table.notes.push_back(fmt::format(
        "Totals of single runs: median {}, 95 % of these runs below {}, worst {} (run {}).",
        figure_text(totals->median), figure_text(totals->percentile_95), figure_text(totals->worst),
        totals->worst_run.value));
  }
  return table;
}

ReviewTable cause_table(const Review& review) {
  ReviewTable table{.id = "cause-table",
                    .caption = "The errors as sums of draws and of products of two",
                    .columns = {{.title = "error of", .is_text = true},
                                {.title = "term", .is_text = true},
                                {.title = "slope, SI"},
                                {.title = "of the variance, %"},
                                {.title = "p"}},
                    .rows = {},
                    .notes = {}};
  if (!review.causes) return table;
  for (const CauseTerm& term : review.causes->terms) {
    table.rows.push_back({heading_cell(model().results().quantities[term.quantity].symbol),
                          heading_cell(term.name),
                          figure_cell(term.slope),
                          scaled_cell(term.share, 0.01),
                          {.text = term.p_value < 1e-9 ? "<10⁻⁹" : figure_text(term.p_value)}});
  }
  table.notes.push_back(fmt::format(
      "Computed from {} of {} runs with an estimate{}. Of the variance: beyond that of the terms "
      "above. p: that chance alone makes one of all quantities and products look so.",
      review.causes->num_runs, review.causes->num_with_estimate,
      review.causes->num_runs < review.causes->num_with_estimate ? ", the first ones" : ""));
  return table;
}

ReviewTable identity_table(const Review& review) {
  const CampaignIdentity& identity = review.identity;
  const CampaignStatistics& statistics = review.results.statistics;
  ReviewTable table{
      .id = "identity",
      .caption = "The campaign",
      .columns = {{.title = "what", .is_text = true}, {.title = "value", .is_text = true}},
      .rows = {pair_of("campaign", identity.name), pair_of("seed", std::to_string(identity.seed)),
               pair_of("runs",
                       fmt::format("{} finished of {}, {} with an estimate", statistics.num_runs,
                                   identity.num_runs, statistics.num_estimated)),
               pair_of("not converged", std::to_string(statistics.num_not_converged)),
               pair_of("with a warning", std::to_string(review.results.warnings.num_runs)),
               pair_of("without an estimate",
                       review.missing.total() == 0 ? "none" : reasons_text(review.missing)),
               pair_of("model", identity.model_version), pair_of("build", identity.build),
               pair_of("created", identity.created_utc),
               pair_of("SHA-256 of the results", digest_words(review)),
               pair_of("SHA-256 of the definition", identity.definition_digest)},
      .notes = {}};
  if (!review.stop.empty()) table.rows.push_back(pair_of("stop rule", review.stop));
  return table;
}

ReviewTable execution_table(const Review& review) {
  const Execution& execution = review.execution;
  ReviewTable table{
      .id = "execution",
      .caption = "How it was computed",
      .columns = {{.title = "what", .is_text = true}, {.title = "value", .is_text = true}},
      .rows = {pair_of("time of processor cores", hours(execution.compute_s)),
               pair_of("first and last result", execution.first_result_utc.value_or("none") +
                                                    " to " +
                                                    execution.last_result_utc.value_or("none")),
               pair_of("workers", fmt::format("{} on {} machines", execution.num_workers,
                                              execution.num_hosts)),
               pair_of("starts of a coordinator", std::to_string(execution.num_coordinators)),
               pair_of("results of a later attempt than the first",
                       std::to_string(execution.num_retried)),
               pair_of("results computed a second time",
                       fmt::format("{}, {} of them differed", execution.num_audited,
                                   execution.num_contradicting)),
               pair_of("runs given up", std::to_string(review.num_given_up))},
      .notes = {}};
  for (const LossShare& loss : execution.losses) {
    table.rows.push_back(
        pair_of(fmt::format("lost: {}", loss.reason),
                fmt::format("{} runs in {} losses, {}", loss.num_runs, loss.num_losses,
                            loss.is_blamed ? "counted against these runs" : "no run is blamed")));
  }
  return table;
}

ReviewTable host_table(const Review& review) {
  ReviewTable table{.id = "machines",
                    .caption = "Machines",
                    .columns = {{.title = "machine", .is_text = true},
                                {.title = "workers"},
                                {.title = "results"},
                                {.title = "core time"}},
                    .rows = {},
                    .notes = {}};
  for (const HostShare& host : review.execution.hosts) {
    table.rows.push_back({heading_cell(host.host),
                          {.text = std::to_string(host.num_workers)},
                          {.text = std::to_string(host.num_results)},
                          {.text = hours(host.compute_s)}});
  }
  if (review.execution.num_hosts > review.execution.hosts.size()) {
    table.notes.push_back(fmt::format("The first {} of {} machines, by results.",
                                      review.execution.hosts.size(), review.execution.num_hosts));
  }
  return table;
}

std::vector<std::pair<std::string, std::string>> reproducing_commands(const Review& review) {
  const std::string database = wire::shell_word(review.database);
  std::vector<std::pair<std::string, std::string>> commands{
      {fmt::format("proofmass verify {} --fraction 0.1", database),
       "checks the database, simulates a tenth of the runs again and compares all bits"},
      {fmt::format("proofmass report {} --html report.html", database), "makes this report anew"}};
  if (!review.matrix.empty() && review.matrix.back().worst) {
    commands.emplace_back(
        fmt::format("proofmass replay {} --run {} --output run{}.h5", database,
                    review.matrix.back().worst->run.value, review.matrix.back().worst->run.value),
        "writes the time series of the worst run");
  }
  return commands;
}

}  // namespace proofmass::coordinator
