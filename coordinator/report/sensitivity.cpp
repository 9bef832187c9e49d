#include "coordinator/report/sensitivity.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "coordinator/report/json.hpp"
#include "coordinator/report/read_results.hpp"
#include "coordinator/report/report.hpp"
#include "coordinator/table/table.hpp"
#include "core/error.hpp"
#include "core/model.hpp"
#include "core/statistics/correlation.hpp"
#include "core/statistics/interval.hpp"
#include "core/statistics/moments.hpp"
#include "core/statistics/sensitivity.hpp"

namespace proofmass::coordinator {
namespace {

constexpr std::size_t num_terms_max = 3;  // Of the sum that explains an error.
constexpr std::size_t num_rows_by_default = 5;
constexpr double p_value_min = 1e-9;  // Below it the approximations of the tests do not hold.

std::vector<std::string> column_names(const Campaign& campaign, const ResultSchema& schema) {
  std::vector<std::string> names;
  for (const DrawnQuantity& drawn : campaign.model().drawn()) names.emplace_back(drawn.name);
  for (const Quantity& quantity : schema.quantities) {
    names.push_back("truth_" + quantity.column());
  }
  return names;
}

void append(const RunResult& result, const RunDraw& draw, DrawnRuns& drawn) {
  drawn.runs.push_back(result.run);
  const std::size_t num_drawn = draw.values.size();
  for (std::size_t i = 0; i < num_drawn; ++i) drawn.columns[i].push_back(draw.values[i]);
  for (std::size_t i = 0; i < result.truth.size(); ++i) {
    drawn.columns[num_drawn + i].push_back(result.truth[i]);
    drawn.errors[i].push_back(result.error(i));
  }
}

/// A truth that is a drawn quantity itself counts once.
void drop_repeated_truths(DrawnRuns& drawn, std::size_t num_drawn) {
  for (std::size_t i = drawn.columns.size(); i-- > num_drawn;) {
    const auto end = drawn.columns.begin() + static_cast<std::ptrdiff_t>(num_drawn);
    if (std::find(drawn.columns.begin(), end, drawn.columns[i]) == end) continue;
    drawn.columns.erase(drawn.columns.begin() + static_cast<std::ptrdiff_t>(i));
    drawn.names.erase(drawn.names.begin() + static_cast<std::ptrdiff_t>(i));
  }
}

std::vector<proofmass::Column> inputs_of(const DrawnRuns& drawn) {
  return {drawn.columns.begin(), drawn.columns.end()};
}

/// Of error and |error|, the most significant first.
std::vector<std::vector<Sensitivity>> sensitivities_of(const DrawnRuns& drawn,
                                                       std::size_t quantity) {
  const std::vector<double>& errors = drawn.errors[quantity];
  std::vector<double> magnitudes(errors.size());
  std::ranges::transform(errors, magnitudes.begin(), [](double error) { return std::abs(error); });
  const std::vector<proofmass::Column> inputs = inputs_of(drawn);
  const std::vector<proofmass::Column> outputs{errors, magnitudes};
  return sensitivities(inputs, outputs, default_confidence, 2 * drawn.errors.size());
}

std::string share_of(const FirstOrderIndex& index) {
  return fmt::format("{:.1f} ({:.1f}, {:.1f})", 100.0 * index.index, 100.0 * index.interval.lower,
                     100.0 * index.interval.upper);
}

std::string p_value_cell(double p_value) {
  return p_value < p_value_min ? fmt::format("<{:.0e}", p_value_min) : measured_figure(p_value);
}

double percentile_of(const std::vector<double>& values, double value) {
  const auto below = std::ranges::count_if(values, [&](double other) { return other < value; });
  return 100.0 * static_cast<double>(below) / static_cast<double>(values.size());
}

/// The quantities that drive an output: how sure that is, or, of one run, what it drew.
/// @param position  Of the run.
Table driver_table(const DrawnRuns& drawn, std::span<const Sensitivity> rows,
                   std::string_view output, std::optional<std::size_t> position) {
  if (rows.empty()) {
    return {.notes = {fmt::format("{}: no input found whose influence chance does not explain; "
                                  "--rows 5 lists the first ones nevertheless",
                                  output)}};
  }
  Table table{.columns = {{fmt::format("drives {}", output), true, 39}}};
  if (position) {
    table.columns.insert(
        table.columns.end(),
        {{"% of variance", false, 14}, {"value", false, 9}, {"% below", false, 9}});
  } else {
    table.columns.insert(table.columns.end(),
                         {{"% of variance (95 %)", false, 21}, {"rank", false, 9}});
  }
  table.columns.push_back({"p", false, position ? 9u : 11u});
  for (const Sensitivity& row : rows) {
    Row& cells = table.rows.emplace_back();
    cells = {drawn.names[row.input]};
    if (position) {
      const std::vector<double>& values = drawn.columns[row.input];
      const double value = values[*position];
      cells.emplace_back(fmt::format("{:.1f}", 100.0 * row.first_order.index));
      cells.emplace_back(fmt::format("{:.3g}", value));
      cells.emplace_back(fmt::format("{:.1f}", percentile_of(values, value)));
    } else {
      cells.emplace_back(share_of(row.first_order));
      cells.emplace_back(fmt::format("{:+.2f}", row.rank_correlation));
    }
    cells.emplace_back(p_value_cell(row.adjusted_p_value));
  }
  return table;
}

std::string one_of(std::size_t count, std::string_view thing) {
  return count == 1 ? fmt::format("the {}", thing) : fmt::format("one of {} {}s", count, thing);
}

/// Names the drivers whose values go together; empty if there are none.
std::string dependence_note(const DrawnRuns& drawn, std::span<const Sensitivity> of_error,
                            std::span<const Sensitivity> of_magnitude) {
  std::set<std::size_t> inputs;
  for (const auto& rows : {of_error, of_magnitude}) {
    for (const Sensitivity& row : rows) inputs.insert(row.input);
  }
  // Chance makes less of independent values, and what is less hardly matters: r² is the share.
  const double least = std::max(0.3, 4.0 / std::sqrt(static_cast<double>(drawn.runs.size())));
  std::string pairs;
  for (const std::size_t i : inputs) {
    for (const std::size_t j : inputs) {
      if (j <= i) continue;
      const double r = linear_correlation(drawn.columns[i], drawn.columns[j]).value_or(0.0);
      if (std::abs(r) < least) continue;
      pairs += fmt::format("{}{} and {} ({:.2f})", pairs.empty() ? "" : ", ", drawn.names[i],
                           drawn.names[j], r);
    }
  }
  if (pairs.empty()) return "";
  return "correlated, so that a share of one may be the other's: " + pairs;
}

/// What it means that no term was found: the fewer runs, the less.
std::string not_found_text(const DrawnRuns& drawn) {
  const double percent =
      100.0 * term_share_found(inputs_of(drawn), default_confidence, drawn.errors.size());
  const std::string text =
      "No term, a quantity or a product of two, was found to explain the error";
  if (percent >= 100.0) {
    return fmt::format("{}: {} runs are too few to find any", text, drawn.runs.size());
  }
  return fmt::format(
      "{}: {} runs find a quantity that explains {} % of its variance in half of the cases, a "
      "product, or what varies by a few draws far out, less often",
      text, drawn.runs.size(), measured_figure(percent));
}

/// The values that a term has in the runs, see ExplanatoryTerm.
std::vector<double> values_of_term(const DrawnRuns& drawn, const ExplanatoryTerm& term) {
  if (!term.second) return drawn.columns[term.first];
  std::vector<double> values = factor_values(drawn.columns[term.first]);
  const std::vector<double> other = factor_values(drawn.columns[*term.second]);
  for (std::size_t i = 0; i < values.size(); ++i) values[i] *= other[i];
  return values;
}

/// The name of a column, of its square or of the product of two: `truth_gain × truth_offset_m`.
std::string term_name(const DrawnRuns& drawn, const ExplanatoryTerm& term) {
  const std::string& first = drawn.names[term.first];
  if (!term.second) return first;
  return term.second == term.first ? fmt::format("({})²", first)
                                   : fmt::format("{} × {}", first, drawn.names[*term.second]);
}

/// The sum of quantities and products of two that explains the error.
/// @param position  Of a run: what each adds to its error, less the mean of all.
Table term_table(const DrawnRuns& drawn, std::size_t quantity,
                 std::span<const ExplanatoryTerm> terms, std::optional<std::size_t> position) {
  if (terms.empty()) return {.notes = {not_found_text(drawn)}};
  const Quantity& info = drawn.quantities[quantity];
  Table table{.columns = {{"error as a sum of", true, 44},
                          {position ? "of this run" : "slope", false, 12},
                          {"of variance", false, 13},
                          {"p", false, 11}}};
  table.notes = {
      fmt::format("{}; products: of quantities less means that are not 0; of variance: R², "
                  "beyond that of the terms above; p: that chance alone makes one of all "
                  "quantities, or of products of two beyond their factors, look so in {}",
                  position ? fmt::format("of this run: what the term, less its mean, "
                                         "adds to the error, {}",
                                         info.display_unit)
                           : "slope: in SI units",
                  one_of(drawn.errors.size(), "error"))};
  for (const ExplanatoryTerm& term : terms) {
    double figure = term.slope;
    if (position) {
      const std::vector<double> values = values_of_term(drawn, term);
      figure *= (values[*position] - moments(values).mean) / info.display_scale;
    }
    table.rows.push_back({term_name(drawn, term), fmt::format("{:.3g}", figure),
                          fmt::format("{:.1f} %", 100.0 * term.share), p_value_cell(term.p_value)});
  }
  return table;
}

/// Which runs were used, and which were not.
std::string basis_text(const DrawnRuns& drawn) {
  std::string text;
  if (drawn.is_part()) {
    text = fmt::format("Computed from {} of {} runs with an estimate: the first {}{}\n",
                       drawn.runs.size(), drawn.num_with_estimate, drawn.num_first,
                       drawn.runs.size() > drawn.num_first ? " and this one" : "");
  }
  const std::string reasons = reasons_text(drawn.missing);
  return reasons.empty() ? text : text + "Left out, without an estimate: " + reasons + "\n";
}

RunIndex worst_run_of(const DrawnRuns& drawn, std::size_t quantity) {
  const std::vector<double>& errors = drawn.errors[quantity];
  const auto worst =
      std::ranges::max_element(errors, {}, [](double error) { return std::abs(error); });
  return drawn.runs[static_cast<std::size_t>(worst - errors.begin())];
}

/// The rows to name: as many as were asked for, else the first five, but none where no quantity has
/// an influence that chance does not explain.
std::span<const Sensitivity> first_of(const std::vector<Sensitivity>& rows,
                                      std::optional<std::size_t> num_rows) {
  const bool is_found = !rows.empty() && rows.front().adjusted_p_value < 1.0 - default_confidence;
  const std::size_t count = num_rows.value_or(is_found ? num_rows_by_default : 0);
  return std::span(rows).first(std::min(count, rows.size()));
}

/// Nothing if no run is asked for.
std::optional<std::size_t> position_of(const DrawnRuns& drawn, std::optional<RunIndex> run) {
  if (!run) return std::nullopt;
  const auto found = std::ranges::lower_bound(drawn.runs, *run);
  if (found == drawn.runs.end() || *found != *run) {
    const std::string last =
        drawn.last_with_estimate ? fmt::to_string(drawn.last_with_estimate->value) : "none";
    throw InvalidArgument(fmt::format("run = {} (must have an estimate, as {} runs up to {} have)",
                                      run->value, drawn.num_with_estimate, last));
  }
  return static_cast<std::size_t>(found - drawn.runs.begin());
}

/// 1 for the largest |error|.
std::size_t rank_of(const std::vector<double>& errors, std::size_t position) {
  const double magnitude = std::abs(errors[position]);
  return 1 + static_cast<std::size_t>(std::ranges::count_if(
                 errors, [&](double error) { return std::abs(error) > magnitude; }));
}

Json json_of(const DrawnRuns& drawn, std::span<const Sensitivity> rows,
             std::optional<std::size_t> position) {
  return array_of(rows, [&](const Sensitivity& row) -> Json {
    const FirstOrderIndex& index = row.first_order;
    const std::vector<double>& values = drawn.columns[row.input];
    return {{"quantity", drawn.names[row.input]},
            {"fraction_of_variance", index.index},
            {"interval", index.interval},
            {"rank_correlation", row.rank_correlation},
            {"p_value", row.adjusted_p_value},
            {"run_value", position ? Json(values[*position]) : Json(nullptr)},
            {"run_percentile",
             position ? Json(percentile_of(values, values[*position])) : Json(nullptr)}};
  });
}

Json json_of_terms(const DrawnRuns& drawn, std::size_t quantity) {
  return array_of(terms_of(drawn, quantity), [&](const ExplanatoryTerm& term) -> Json {
    return {{"quantity", drawn.names[term.first]},
            {"times", term.second ? Json(drawn.names[*term.second]) : Json(nullptr)},
            {"slope", term.slope},
            {"fraction_of_variance", term.share},
            {"p_value", term.p_value}};
  });
}

}  // namespace

std::vector<ExplanatoryTerm> terms_of(const DrawnRuns& drawn, std::size_t quantity) {
  return explanatory_terms(inputs_of(drawn), drawn.errors[quantity], num_terms_max,
                           default_confidence, drawn.errors.size());
}

DrawnRuns read_drawn_runs(const Store& store, const Campaign& campaign, std::uint64_t num_runs_max,
                          std::optional<RunIndex> also) {
  const ResultSchema& schema = store.schema();
  DrawnRuns drawn;
  drawn.names = column_names(campaign, schema);
  drawn.quantities = schema.quantities;
  drawn.columns.resize(drawn.names.size());
  drawn.errors.resize(schema.quantities.size());
  drawn.missing.num_given_up = num_runs_in(store.given_up_runs());
  (void)walk_checked(store, [&](const RunResult& result) {
    const bool is_first = drawn.num_first < num_runs_max;
    if (!result.is_completed()) {
      if (is_first) drawn.missing.add(result);
      return;
    }
    ++drawn.num_with_estimate;
    drawn.last_with_estimate = result.run;
    if (!is_first && result.run != also) return;
    if (is_first) ++drawn.num_first;
    require_in_range(result, schema);
    const RunDraw draw = campaign.draw(result.run);
    if (draw.truth.empty()) {
      store.refuse_as_damaged(fmt::format(
          "run {} has an estimate, and its definition yields no draw", result.run.value));
    }
    append(result, draw, drawn);
  });
  if (!drawn.runs.empty()) drop_repeated_truths(drawn, campaign.model().drawn().size());
  return drawn;
}

std::string sensitivity_text(const DrawnRuns& drawn, std::size_t quantity,
                             std::optional<RunIndex> run, std::optional<std::size_t> num_rows,
                             Paint paint) {
  const TerminalStyle style = document_style(paint);
  const Quantity& info = drawn.quantities[quantity];
  const std::vector<double>& errors = drawn.errors[quantity];
  const std::optional<std::size_t> position = position_of(drawn, run);
  const auto both = sensitivities_of(drawn, quantity);
  const auto of_error = first_of(both[0], num_rows), of_magnitude = first_of(both[1], num_rows);
  const bool has_rows = !of_error.empty() || !of_magnitude.empty();
  const std::vector<ExplanatoryTerm> terms = terms_of(drawn, quantity);
  if (!position && !has_rows && terms.empty()) return {};
  Table drivers = driver_table(drawn, of_error, "error", position);
  if (has_rows) {
    drivers.notes.push_back(fmt::format(
        "{}; p: that chance alone makes {} look so influential on {} or {} (Kruskal-Wallis, Holm)",
        position ? "% below: of the runs"
                 : "% of variance: with its 95 % interval; rank: rank correlation",
        one_of(both[1].size(), "input"), one_of(drawn.errors.size(), "error"),
        drawn.errors.size() == 1 ? "its magnitude" : "their magnitudes"));
    const std::string dependence = dependence_note(drawn, of_error, of_magnitude);
    if (!dependence.empty()) drivers.notes.push_back(dependence);
  }
  const std::uint64_t worst = worst_run_of(drawn, quantity).value;
  const std::string largest =
      fmt::format("\nLargest |error|{}: run {}{}\n", drawn.of_these(), worst,
                  has_rows ? fmt::format("; why: --run {} --parameter {}", worst, info.name) : "");
  const std::string heading = position
                                  ? fmt::format("Run {}: error of {} {}, rank {} of {}", run->value,
                                                info.symbol, quantity_text(errors[*position], info),
                                                rank_of(errors, *position), errors.size())
                                  : fmt::format("{}: {} runs", info.symbol, errors.size());
  return fmt::format("{}\n{}\n{}\n{}\n{}{}", heading, basis_text(drawn),
                     terminal_text(driver_table(drawn, of_magnitude, "|error|", position), style),
                     terminal_text(drivers, style),
                     terminal_text(term_table(drawn, quantity, terms, position), style),
                     position ? "" : fitted(largest));
}

std::string unexplained_text(const DrawnRuns& drawn, std::span<const std::size_t> quantities) {
  std::vector<std::string> names;
  for (const std::size_t quantity : quantities) {
    names.push_back(fmt::format("{} (largest{}: run {})", drawn.quantities[quantity].symbol,
                                drawn.of_these(), worst_run_of(drawn, quantity).value));
  }
  const Table table{
      .notes = {fmt::format("No input found whose influence on these errors or their magnitudes "
                            "chance does not explain; --rows 5 lists the first ones nevertheless: "
                            "{}",
                            fmt::join(names, ", ")),
                not_found_text(drawn)}};
  return basis_text(drawn) + terminal_text(table);
}

std::size_t worst_quantity_of(const DrawnRuns& drawn, RunIndex run,
                              std::span<const double> objectives) {
  const std::size_t position = *position_of(drawn, run);
  // Where no parameter has an objective, the rank among the runs decides.
  const auto badness = [&](std::size_t quantity) {
    const std::vector<double>& errors = drawn.errors[quantity];
    return std::pair(std::abs(errors[position]) / objectives[quantity],
                     errors.size() - rank_of(errors, position));
  };
  std::size_t worst = 0;
  for (std::size_t i = 1; i < drawn.errors.size(); ++i) {
    if (badness(i) > badness(worst)) worst = i;
  }
  return worst;
}

std::string choice_text(const DrawnRuns& drawn, RunIndex run, std::span<const double> objectives) {
  const std::size_t quantity = worst_quantity_of(drawn, run, objectives);
  const std::string& name = drawn.quantities[quantity].name;
  if (!std::isfinite(objectives[quantity])) {
    return fmt::format("Of {}, no parameter having an objective: that of the highest rank\n", name);
  }
  const double ratio =
      std::abs(drawn.errors[quantity][*position_of(drawn, run)]) / objectives[quantity];
  return fmt::format(
      "Of {}, as its error is the largest beside its objective: {:.3g} times that\n"
      "(another parameter: --parameter NAME)\n",
      name, ratio);
}

Json sensitivity_json(const DrawnRuns& drawn, std::span<const std::size_t> quantities,
                      std::optional<RunIndex> run, std::optional<std::size_t> num_rows) {
  const std::optional<std::size_t> position = position_of(drawn, run);
  const auto of_quantity = [&](std::size_t quantity) -> Json {
    const std::vector<double>& errors = drawn.errors[quantity];
    const auto both = sensitivities_of(drawn, quantity);
    return {{"parameter", drawn.quantities[quantity].name},
            {"unit", drawn.quantities[quantity].unit},
            {"worst_run", worst_run_of(drawn, quantity).value},
            {"run_error", position ? Json(errors[*position]) : Json(nullptr)},
            {"run_rank", position ? Json(rank_of(errors, *position)) : Json(nullptr)},
            {"drives_magnitude", json_of(drawn, first_of(both[1], num_rows), position)},
            {"drives_error", json_of(drawn, first_of(both[0], num_rows), position)},
            {"terms", json_of_terms(drawn, quantity)}};
  };
  return {{"run", run ? Json(run->value) : Json(nullptr)},
          {"num_runs", drawn.runs.size()},
          {"num_with_estimate", drawn.num_with_estimate},
          {"confidence", default_confidence},
          {"parameters", array_of(quantities, of_quantity)}};
}

namespace {

constexpr std::size_t num_correlated_of_each = 3;

// Shares and slopes are known to a percent from these, and the search takes seconds.
constexpr std::uint64_t cause_runs_max = 20'000;

using Correlations = std::vector<std::optional<double>>;  // With the error of each quantity.

Correlations correlations_of(std::span<const double> input, const DrawnRuns& drawn) {
  Correlations correlations;
  const double least = 4.0 / std::sqrt(static_cast<double>(input.size()));
  for (const std::vector<double>& errors : drawn.errors) {
    correlations.push_back(linear_correlation(input, errors));
    if (correlations.back() && std::abs(*correlations.back()) < least) correlations.back().reset();
  }
  return correlations;
}

void add_input(Causes& causes, const std::string& name, Correlations correlations) {
  if (std::ranges::find(causes.inputs, name) != causes.inputs.end()) return;
  causes.inputs.push_back(name);
  causes.correlations.push_back(std::move(correlations));
}

void add_terms(const DrawnRuns& drawn, std::size_t quantity, Causes& causes) {
  for (const ExplanatoryTerm& term : terms_of(drawn, quantity)) {
    const std::string name = term_name(drawn, term);
    causes.terms.push_back({quantity, name, term});
    add_input(causes, name, correlations_of(values_of_term(drawn, term), drawn));
  }
}

/// The columns that correlate the most with the error of a quantity.
void add_correlated(const DrawnRuns& drawn, std::size_t quantity,
                    std::span<const Correlations> of_columns, Causes& causes) {
  std::vector<std::pair<double, std::size_t>> ranked;
  for (std::size_t i = 0; i < of_columns.size(); ++i) {
    if (const auto& coefficient = of_columns[i][quantity]) {
      ranked.emplace_back(-std::abs(*coefficient), i);
    }
  }
  std::ranges::sort(ranked);
  if (ranked.size() > num_correlated_of_each) ranked.resize(num_correlated_of_each);
  for (const auto& [strength, column] : ranked) {
    add_input(causes, drawn.names[column], of_columns[column]);
  }
}

}  // namespace

std::optional<Causes> find_causes(const Store& store, const Campaign& campaign) {
  DrawnRuns drawn = read_drawn_runs(store, campaign, cause_runs_max);
  if (drawn.runs.size() < sensitivity_values_min) return std::nullopt;
  const std::vector<Quantity>& quantities = drawn.quantities;
  for (const Quantity& quantity : quantities) {  // A truth that is drawn itself has no column.
    const std::string of_truth = "truth_" + quantity.column();
    std::ranges::replace(drawn.names, of_truth, fmt::format("true {}", quantity.symbol));
  }
  Causes causes{.num_runs = drawn.runs.size(), .num_with_estimate = drawn.num_with_estimate};
  std::vector<Correlations> of_columns;
  for (const auto& column : drawn.columns) of_columns.push_back(correlations_of(column, drawn));
  for (std::size_t i = 0; i < drawn.errors.size(); ++i) add_terms(drawn, i, causes);
  for (std::size_t i = 0; i < drawn.errors.size(); ++i) {
    add_correlated(drawn, i, of_columns, causes);
  }
  return causes;
}

}  // namespace proofmass::coordinator
