#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <regex>

#include "coordinator/charts/chart.hpp"
#include "coordinator/report/report.hpp"
#include "coordinator/report/requirements.hpp"
#include "coordinator/table/table.hpp"
#include "proto/link/machine.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

/// A table of names and what they have.
Table facts(std::string id, std::string caption, std::vector<Row> rows) {
  return {.id = std::move(id),
          .caption = std::move(caption),
          .columns = {{"what", true}, {"value", true}},
          .rows = std::move(rows)};
}

/// A text of lines, the first of which begins with the name of all or with blanks.
std::string in_one_line(std::string_view lines) {
  static const std::regex end_of_line("(:)\\n\\s*|\\n\\s*"), name("^\\S*\\s+"), gap(" {2,}");
  std::string text(lines.substr(0, lines.find_last_not_of('\n') + 1));
  text = std::regex_replace(text, end_of_line, "; ");
  return std::regex_replace(std::regex_replace(text, name, ""), gap, " ");
}

/// `1.2×10⁻¹²` for each `1.2e-12` of a text.
std::string with_powers_of_ten(const std::string& text) {
  static const std::regex program_spelling("[0-9]+(\\.[0-9]+)?e[-+][0-9]+");
  std::string result;
  std::smatch found;
  auto begin = text.begin();
  for (; std::regex_search(begin, text.end(), found, program_spelling); begin = found[0].second) {
    // Unlike std::stod this takes subnormal numbers.
    result += found.prefix().str() + figure_text(std::strtod(found.str().c_str(), nullptr));
  }
  return result + std::string(begin, text.end());
}

Table cause_table(const Review& review) {
  if (!review.causes || review.causes->terms.empty()) return {};
  Table table{
      .id = "cause-table",
      .caption = "The errors as sums of draws and of products of two",
      .columns = {
          {"error of", true}, {"term", true}, {"slope, SI"}, {"of the variance, %"}, {"p"}}};
  for (const CauseTerm& term : review.causes->terms) {
    table.rows.push_back({review.schema.quantities[term.quantity].symbol, term.name,
                          figure_cell(term.found.slope), figure_cell(term.found.share, 0.01),
                          term.found.p_value < 1e-9 ? "<10⁻⁹" : figure_text(term.found.p_value)});
  }
  table.notes.push_back(fmt::format(
      "Computed from {} of {} runs with an estimate{}. Products: of quantities less means that are "
      "not 0. Of the variance: beyond that of the terms above; what is in no row may depend on "
      "draws otherwise, as `proofmass sensitivity` tells. p: that chance alone makes one of all "
      "quantities, or of products beyond their factors, look so.",
      review.causes->num_runs, review.causes->num_with_estimate,
      review.causes->num_runs < review.causes->num_with_estimate ? ", the first ones" : ""));
  return table;
}

Table identity_table(const Review& review) {
  Table table = facts("identity", "The campaign", {});
  for (Row& row : summary_rows(review)) {
    if (row[0].text.empty()) {
      table.rows.back()[1].text += "; " + row[1].text;
    } else {
      table.rows.push_back(std::move(row));
    }
  }
  const auto add = [&](std::string_view name, const std::string& text) {
    if (!text.empty()) table.rows.push_back({name, text});
  };
  add("Warnings", in_one_line(warnings_text(review.schema, review.results.warnings)));
  add("Model", review.model_version);
  add("Build", review.build);
  add("Created", review.created_utc);
  add("Definition", review.definition_digest);
  add("Stopping", in_one_line(review.stop ? review.stop->text : ""));
  add("Note", review.note);
  return table;
}

Table execution_table(const Review& review) {
  const CampaignExecution& execution = review.execution;
  Table table = facts(
      "execution", "How it was computed",
      {{"time of all runs, added up", duration_text(execution.compute_s)},
       {"first and last result",
        execution.first_result_utc.empty()
            ? "none to none"
            : execution.first_result_utc + " to " + execution.last_result_utc},
       {"workers",
        fmt::format("{} on {}", execution.num_workers, counted(execution.num_hosts, "machine"))},
       {"starts of a coordinator", std::to_string(execution.num_coordinators)},
       {"results of a later attempt than the first", std::to_string(execution.num_retried)},
       {"results computed a second time",
        fmt::format("{}, {} of them differed", execution.num_audited, review.num_contradicting)},
       {"runs given up", std::to_string(review.results.missing.num_given_up)}});
  for (const LossCount& loss : execution.losses) {
    table.rows.push_back(
        {fmt::format("lost: {}", loss.reason),
         fmt::format("{} runs in {} losses, {}", loss.num_runs, loss.num_losses,
                     loss.num_blamed > 0 ? "counted against these runs" : "no run is blamed")});
  }
  return table;
}

/// Runs a second; a database keeps whole seconds, so that a short campaign has none.
std::string rate_text(const HostShare& host) {
  if (host.serving_s < 10.0) return "unknown";
  return fmt::format("{:.2g}", static_cast<double>(host.num_results) / host.serving_s);
}

Table host_table(const Review& review) {
  if (review.execution.hosts.empty()) return {};
  Table table{
      .id = "machines",
      .caption = "Machines",
      .columns = {
          {"machine", true}, {"cards", true}, {"workers"}, {"results"}, {"runs/s"}, {"run time"}}};
  for (const HostShare& host : review.execution.hosts) {
    table.rows.push_back({host.host, host.cards.empty() ? "none" : host.cards,
                          std::to_string(host.num_workers), std::to_string(host.num_results),
                          rate_text(host), duration_text(host.compute_s)});
  }
  table.notes.push_back(
      "runs/s: results over the time from the first registration of a worker to the last result, "
      "in "
      "whole seconds; unknown below ten.");
  if (review.execution.num_hosts > review.execution.hosts.size()) {
    table.notes.push_back(fmt::format("The first {} of {} machines, by results.",
                                      review.execution.hosts.size(), review.execution.num_hosts));
  }
  return table;
}

Cell count_cell(std::uint64_t count) { return {std::to_string(count), static_cast<double>(count)}; }

/// `|error| of a_c12`, or the budget or a term of it.
std::string subject_of(const RequirementAnswer& row) {
  if (row.is_joint()) return "all objectives";
  const std::string symbol(row.subject.symbol);
  return row.is_of_error ? "|error| of " + symbol : symbol;
}

/// The number that figure_text() spells, whose whole numbers have all their digits.
double shown_with(double value, int num_digits) {
  if (num_digits < 5 && std::abs(value) >= 1e3 && std::abs(value) < 1e5) return std::round(value);
  return std::strtod(fmt::format("{:.{}e}", value, num_digits - 1).c_str(), nullptr);
}

/// Three digits, or as many as show on which side of a limit a value lies.
int num_digits_beside(double value, double limit) {
  int num_digits = 3;
  for (; num_digits < 15; ++num_digits) {
    const double shown = shown_with(value, num_digits);
    if ((shown < limit) == (value < limit) && (shown > limit) == (value > limit)) break;
  }
  return num_digits;
}

/// In the unit of the tables; a ratio to the objectives without one.
Cell value_cell(const RequirementAnswer& row, const std::optional<double>& value) {
  if (!value) return "none";
  const double scale = row.is_joint() ? 1.0 : row.subject.display_scale;
  const int num_digits = num_digits_beside(*value / scale, row.limit() / scale);
  return {row.is_joint() ? figure_text(*value, num_digits) + " × objective"
                         : quantity_text(*value, row.subject, num_digits),
          *value};
}

/// With its relation and the digits that somebody gave it.
Cell limit_cell(const RequirementAnswer& row) {
  if (row.is_joint()) return {"≤ 1 × objective", row.limit()};
  return {fmt::format("{} {}", row.requirement.admits_limit ? "≤" : "<",
                      quantity_text(row.limit(), row.subject, 10)),
          row.limit()};
}

/// Of so few draws none can meet the requirement: those which do with as many exceedances.
Cell allowed_cell(const RequirementCheck& check) {
  if (check.bound_order > 0) return count_cell(check.bound_order - 1);
  if (!check.num_runs_at_best) return "too few draws";
  return fmt::format("{} of {}", check.num_exceedances, *check.num_runs_at_best);
}

Cell margin_cell(const RequirementAnswer& row) {
  const std::optional<double> margin = row.relative_margin();
  if (!margin) return "none";
  return {figure_text(100.0 * *margin) + " %", *margin};
}

/// `|error| of a_c12, for 95 % with 90 %`, after the words of the project.
std::string statement_of(const RequirementAnswer& row) {
  const Tolerance& tolerance = row.requirement.tolerance;
  const std::string text =
      fmt::format("{}, for {} with {}", subject_of(row), given_percent(tolerance.coverage),
                  given_percent(tolerance.confidence));
  return row.stated.text.empty() || row.stated.is_default
             ? text
             : fmt::format("{} ({})", row.stated.text, text);
}

Row matrix_cells(const RequirementAnswer& row) {
  const RequirementCheck& check = row.check;
  return {requirement_name(row),
          statement_of(row),
          {name_of(check.verdict), row.is_opposed() ? Tone::open : tone_of(check.verdict)},
          limit_cell(row),
          count_cell(check.num_runs),
          count_cell(check.num_without_estimate),
          count_cell(check.num_exceedances),
          allowed_cell(check),
          value_cell(row, row.bound),
          margin_cell(row),
          value_cell(row, row.worst ? std::optional(row.worst->value) : std::nullopt),
          row.worst ? count_cell(row.worst->run.value) : Cell("none")};
}

std::string_view draw_sentence(Interpretation interpretation) {
  if (interpretation == Interpretation::ensemble) {
    return "Draws are without noise, and probabilities are over instruments.";
  }
  return interpretation == Interpretation::temporal
             ? "All draws are of one instrument; probabilities are over realisations of the noise."
             : "Each draw is one instrument with one realisation of the noise, and probabilities "
               "are over both together.";
}

std::vector<std::string> matrix_notes(const Review& review) {
  std::vector<std::string> notes{
      fmt::format("Statistical interpretation in the terms of ECSS-E-ST-60-10C: {}. {}",
                  name_of(review.interpretation), draw_sentence(review.interpretation)),
      "Verdicts: " +
          (review.matrix.empty() ? std::string("none") : rule_text(review.matrix.front())) +
          ". With the confidence c of a row a requirement that does not hold is called met with "
          "probability 1 − c at most, the consumer's risk, each row by itself; so is one that "
          "holds called not met. "
          "The producer's risk, that one that holds is not called met, is the smaller the better "
          "it holds and the more draws there are.",
      "A draw without an estimate counts as an exceedance. Allowed are the exceedances with which "
      "so many draws meet the requirement; k of n: too few draws, n with k exceedances would.",
      "Bound: with the confidence of the row, the stated part of all draws does not exceed it "
      "(order statistics, any law). Margin: (limit − bound) / limit."};
  for (const RequirementAnswer& row : review.matrix) {
    if (!row.assumption.empty()) {
      notes.push_back(fmt::format("{} is answered with {}, which no session tells.",
                                  requirement_name(row), row.assumption));
    }
    if (!row.of_all) continue;
    notes.push_back(fmt::format("{} was decided by the first {} draws. {}: {}.",
                                requirement_name(row), row.check.num_runs,
                                row.is_joint() ? "Holding" : "Exceeding", text_of_all(row)));
  }
  if (std::ranges::any_of(review.matrix, &RequirementAnswer::is_joint)) {
    notes.emplace_back(
        "All objectives together: limit and bound are of the largest ratio of an |error| to its "
        "objective in a draw.");
  }
  if (std::ranges::any_of(review.matrix, [](const auto& row) { return row.stated.is_default; })) {
    notes.push_back(fmt::format(
        "Rows made of the objectives of the campaign ask for {} of all draws with {} confidence, "
        "which is the default of the program and not a demand of a project.",
        given_percent(default_tolerance.coverage), given_percent(default_tolerance.confidence)));
  }
  return notes;
}

Table matrix_table(const Review& review) {
  Table table{.id = "matrix",
              .caption = fmt::format("Verification matrix (statistical interpretation: {})",
                                     name_of(review.interpretation)),
              .columns = {{"id", true},
                          {"requirement", true},
                          {"verdict", true},
                          {"limit"},
                          {"draws"},
                          {"without estimate"},
                          {"exceedances"},
                          {"allowed"},
                          {"bound"},
                          {"margin"},
                          {"worst value"},
                          {"in run"}},
              .notes = matrix_notes(review)};
  if (!review.why_not_independent.empty()) {
    table.notes = {fmt::format("No verdicts: {}.", review.why_not_independent)};
    return table;
  }
  for (const RequirementAnswer& row : review.matrix) table.rows.push_back(matrix_cells(row));
  return table;
}

}  // namespace

std::string quantity_text(double value, const Quantity& quantity, int num_digits) {
  const std::string figure = figure_text(value / quantity.display_scale, num_digits);
  if (quantity.display_unit == "1") return figure;
  const std::string unit = unit_text(quantity.display_unit);
  if (!unit.starts_with("10")) return figure + " " + unit;
  const bool has_power = figure.find("×10") != std::string::npos || figure.starts_with("10⁻");
  return has_power
             ? figure_text(value, num_digits) + unit.substr(std::min(unit.find(' '), unit.size()))
             : figure + "×" + unit;
}

std::string name_in_symbols(const ResultSchema& schema, std::string_view name) {
  const std::vector<Quantity>& quantities = schema.quantities;
  const auto found = std::ranges::find(quantities, name, &Quantity::name);
  return std::string(found == quantities.end() ? name : found->symbol);
}

std::string requirement_name(const RequirementAnswer& row) {
  return row.stated.is_default && !row.is_joint() ? std::string(row.subject.symbol) : row.stated.id;
}

std::vector<std::pair<std::string, std::string>> reproducing_commands(const Review& review) {
  const std::string database = wire::shell_word(review.database);
  if (review.is_imported) {
    return {{fmt::format("proofmass verify {}", database), "checks the database"},
            {fmt::format("proofmass report {}{} --html report.html", database, review.options),
             "makes this report anew"}};
  }
  const char* const program = review.is_of_program ? " --model-program PROGRAM" : "";
  std::vector<std::pair<std::string, std::string>> commands{
      {fmt::format("proofmass verify {} --fraction 0.1{}", database, program),
       "checks the database, simulates a tenth of the runs again and compares all bits"},
      {fmt::format("proofmass report {}{} --html report.html", database, review.options),
       "makes this report anew"}};
  if (const std::optional<RunIndex> worst = worst_run_of(review)) {
    const std::string replay = fmt::format("proofmass replay {} --run {}", database, worst->value);
    if (review.is_of_program) {
      commands.emplace_back(replay + program, "simulates the worst run again");
    } else {
      commands.emplace_back(fmt::format("{} --output run{}.h5", replay, worst->value),
                            "writes the time series of the worst run");
    }
  }
  return commands;
}

std::vector<Part> verification_parts(const Review& review) {
  std::vector<Part> parts{matrix_table(review)};
  // Without requirements there is one chart: that of the default tolerance.
  std::string name = "characteristic";
  for (Chart& chart : characteristic_charts(review)) {
    parts.emplace_back(NamedPicture{std::exchange(name, ""), std::move(chart)});
  }
  if (parts.size() > 1) {
    parts.emplace_back(Markup{fmt::format(
        "<p class=\"note\">How probable it is that a campaign of as many draws meets a "
        "requirement ({}), if that part of all draws exceeds its limit. A steep curve tells "
        "good instruments from bad ones; more draws make it steeper.</p>\n",
        name_of(review.interpretation))});
  }
  return parts;
}

std::vector<Part> budget_parts(const Review& review) {
  Table table = budget_table(review);
  for (std::string& note : table.notes) note = with_powers_of_ten(note);
  std::vector<Part> parts{std::move(table)};
  if (auto chart = budget_chart(review)) {
    parts.emplace_back(NamedPicture{"budget", *std::move(chart)});
  }
  return parts;
}

std::vector<Part> cause_parts(const Review& review) {
  std::vector<Part> parts;
  if (auto map = cause_map(review)) {
    parts.emplace_back(Markup{
        "<p>Rows are drawn quantities, true parameters and products of two of them, less means "
        "that are not 0; columns are "
        "the errors with their signs. Cells below four standard errors are empty.</p>\n"});
    parts.emplace_back(NamedPicture{"causes", *std::move(map)});
  }
  parts.emplace_back(cause_table(review));
  return parts;
}

std::vector<Part> run_parts(const Review& review) {
  std::vector<Part> parts{identity_table(review)};
  // The runs of an import were computed elsewhere.
  if (!review.is_imported) {
    parts.emplace_back(execution_table(review));
    parts.emplace_back(host_table(review));
  }
  std::string html = "<h3>How to reproduce it</h3>\n<ul>\n";
  for (const auto& [command, effect] : reproducing_commands(review)) {
    html += fmt::format("<li><code>{}</code> {}</li>\n", wire::markup_text(command),
                        wire::markup_text(effect));
  }
  parts.emplace_back(Markup{html + "</ul>\n"});
  return parts;
}

}  // namespace proofmass::coordinator
