#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <span>
#include <string_view>
#include <utility>
#include <variant>

#include "coordinator/charts/chart.hpp"
#include "coordinator/report/report.hpp"
#include "coordinator/report/requirements.hpp"
#include "coordinator/table/table.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

using wire::markup_text;

// A page may neither load nor run anything, whatever its texts hold.
constexpr std::string_view policy =
    "default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'";

constexpr std::string_view page_style =
    R"(header,main,footer{padding:0 1rem;max-width:90rem;margin:0 auto}
h2{font-size:1.3rem;margin:2rem 0 .5rem;border-bottom:2px solid var(--chart-first)}
nav ul{display:flex;flex-wrap:wrap;gap:.2rem 1rem;padding:0;margin:.5rem 0;list-style:none}
p{max-width:48rem}
#matrix{font-size:.85rem}
#matrix th,#matrix td{padding:.25rem .4rem}
#matrix td:nth-child(2){min-width:min(16rem,30vw)}
#summary{max-width:60rem;padding-left:1.3rem}
@page{size:A4 landscape;margin:12mm}
@media print{
body{font-size:10pt}
nav,.skip{display:none}
.scroll{overflow:visible;background:none}
table,#matrix,.note{font-size:7.5pt}
th,td,#matrix th,#matrix td{padding:.1rem .25rem}
#matrix td:nth-child(2){min-width:13rem}
h2,h3{break-after:avoid}
footer{break-before:avoid}
figure,tr{break-inside:avoid}
.flow{display:block;orphans:1;widows:1}
.flow>*{display:inline-block;vertical-align:top;margin-right:.2rem}
.flow>h3,.flow>p,.flow>ul{display:block}
table{break-inside:avoid}
figure{zoom:.62}
}
)";

struct Section {
  std::string id;
  std::string title;
  std::vector<Part> parts;  ///< None of which is shown: it is left out.
};

bool is_shown(const Table& table) { return !table.rows.empty() || !table.notes.empty(); }

std::vector<Part> parts_of(std::vector<Table> tables) {
  return {std::move_iterator(tables.begin()), std::move_iterator(tables.end())};
}

std::vector<Part> standard_error_parts(const Review& review) {
  const StandardErrorStatistics& statistics = review.results.standard_errors;
  std::vector<Part> parts = parts_of(standard_error_tables(review.schema, statistics));
  if (auto pulls = pull_overview(review.schema, statistics)) {
    parts.emplace_back(NamedPicture{"pulls", *std::move(pulls)});
  }
  return parts;
}

std::vector<Section> sections_of(const Review& review) {
  // What intervals take for their unit instead of the run.
  const char* const groups = review.results.replicates ? "Replicates of the design" : "Instruments";
  return {{"verification", "Verification matrix", verification_parts(review)},
          {"results",
           "Accuracy",
           {accuracy_table(review), interval_table(review), error_table(review)}},
          {"standard-errors-section", "Standard errors", standard_error_parts(review)},
          {"instruments-section", groups, parts_of(group_tables(review))},
          {"distributions", "Errors by parameter", error_parts(review)},
          {"budget-section", "Budget", budget_parts(review)},
          {"causes-section", "Causes of the errors", cause_parts(review)},
          {"spectra-section", "Spectra of the worst run", spectrum_parts(review)},
          {"how", "How it was run", run_parts(review)}};
}

/// A chart that is wider than a phone scrolls.
std::string html_of(const NamedPicture& named) {
  const std::string figure = "<figure>\n" + svg_of(named.picture, SvgUse::embedded) + "</figure>\n";
  if (!std::holds_alternative<HeatMap>(named.picture)) return figure;
  return fmt::format(
      "<div class=\"scroll\" role=\"region\" aria-label=\"{}\" tabindex=\"0\">\n{}</div>\n",
      markup_text(text_of(named.picture).title), figure);
}

std::string html_of(const Table& table) {
  return is_shown(table) ? "<div>\n" + html_table(table) + "</div>\n" : "";
}

std::string html_of(const Markup& markup) { return markup.html; }

std::string summary_markup(const Review& review, std::span<const Section> sections) {
  std::string html =
      fmt::format("<h1>Campaign {}</h1>\n<ol id=\"summary\">\n", markup_text(review.name));
  for (const auto& [text, source] : review_summary(review)) {
    const auto section = std::ranges::find(sections, source, &Section::title);
    html += fmt::format("<li>{} (<a href=\"#{}\">{}</a>)</li>\n", sentence_markup(text),
                        section->id, section->title);
  }
  return html + "</ol>\n";
}

}  // namespace

std::string review_html(const Review& review) {
  std::string navigation;
  std::string content;
  const std::vector<Section> sections = sections_of(review);
  for (const Section& section : sections) {
    std::string markup;
    for (const Part& part : section.parts) {
      markup += std::visit([](const auto& shown) { return html_of(shown); }, part);
    }
    if (markup.empty()) continue;
    navigation += fmt::format("<li><a href=\"#{}\">{}</a></li>\n", section.id, section.title);
    content += fmt::format(
        "<section id=\"{0}\" aria-labelledby=\"{0}-title\">\n<h2 "
        "id=\"{0}-title\">{1}</h2>\n<div class=\"flow\">\n{2}</div>\n</section>\n",
        section.id, section.title, markup);
  }
  return fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta http-equiv=\"Content-Security-Policy\" content=\"{}\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
      "<title>{} – review report</title>\n<style>\n{}{}</style>\n</head>\n<body>\n"
      "<a class=\"skip\" href=\"#content\">Skip to the verification matrix</a>\n"
      "<header>\n{}<nav aria-label=\"Sections\"><ul>\n{}</ul></nav>\n</header>\n"
      "<main id=\"content\">\n{}</main>\n<footer><p>Made by Proofmass from {}.</p></footer>\n"
      "</body>\n</html>\n",
      policy, markup_text(review.name), review_style(), page_style,
      summary_markup(review, sections), navigation, content, markup_text(review.database));
}

std::vector<NamedPicture> review_pictures(const Review& review) {
  std::vector<NamedPicture> pictures{{"errors", magnitude_overview(review)},
                                     {"convergence", convergence_overview(review)}};
  for (Section& section : sections_of(review)) {
    for (Part& part : section.parts) {
      auto* const picture = std::get_if<NamedPicture>(&part);
      if (picture != nullptr && !picture->name.empty()) pictures.push_back(std::move(*picture));
    }
  }
  return pictures;
}

namespace {

/// In a code span nothing is escaped but what ends it and the cell.
std::string code_span(std::string_view text) {
  std::string span;
  for (const char c : wire::visible_text(text)) {
    if (c == '|') span += '\\';
    span += c == '`' ? '\'' : c;
  }
  return "`" + span + "`";
}

}  // namespace

std::string review_markdown(const Review& review) {
  std::string text = fmt::format("# Campaign {}\n\n", markdown_text(review.name));
  for (const auto& [sentence, source] : review_summary(review)) {
    text += fmt::format("- {} ({})\n", markdown_text(sentence), source);
  }
  text += "\n";
  for (const Section& section : sections_of(review)) {
    std::string tables;
    for (const Part& part : section.parts) {
      const auto* const table = std::get_if<Table>(&part);
      if (table != nullptr && is_shown(*table)) tables += markdown_table(*table);
    }
    if (!tables.empty()) text += fmt::format("## {}\n\n{}", section.title, tables);
  }
  text += "## How to reproduce it\n\n";
  for (const auto& [command, effect] : reproducing_commands(review)) {
    text += fmt::format("- {} {}\n", code_span(command), markdown_text(effect));
  }
  return text;
}

namespace {

constexpr std::size_t num_named_max = 8;

/// `a, b and 3 more`.
std::string list_of(const std::vector<std::string>& names) {
  const std::size_t num_named = std::min(names.size(), num_named_max);
  std::string list = fmt::format("{}", fmt::join(std::span(names).first(num_named), ", "));
  if (names.size() > num_named) list += fmt::format(" and {} more", names.size() - num_named);
  return list;
}

/// What results are counted in: realisations share a draw.
std::string_view unit_of(const Review& review) {
  return review.results.instruments ? "runs" : "draws";
}

std::string_view be(std::uint64_t count) { return count == 1 ? "is" : "are"; }

std::string question(const Review& review) {
  if (!review.why_not_independent.empty()) {
    return "No requirement can be judged by this campaign.";
  }
  if (review.matrix.empty()) {
    return "No requirement was given and no parameter has an objective: nothing was asked.";
  }
  std::vector<std::string> names;
  for (const RequirementAnswer& row : review.matrix) {
    if (!row.stated.is_default) names.push_back(requirement_name(row));
  }
  if (names.empty()) {
    return fmt::format(
        "It was asked whether {} of all draws meet the objective of each parameter, and all "
        "objectives together, each with {} confidence, which is the default of the program and no "
        "demand of a project.",
        given_percent(default_tolerance.coverage), given_percent(default_tolerance.confidence));
  }
  return fmt::format("It was asked whether {} {}: {}{}.", names.size(),
                     names.size() == 1 ? "requirement holds" : "requirements hold", list_of(names),
                     names.size() < review.matrix.size() ? ", and all objectives together" : "");
}

std::string draws(const Review& review) {
  const CampaignStatistics& statistics = review.results.statistics;
  const std::uint64_t num_wanted = review.num_runs;
  const std::uint64_t num_done = statistics.num_runs + review.results.missing.num_given_up;
  const std::uint64_t num_missing = num_done - statistics.num_estimated;
  std::string text = num_done < num_wanted
                         ? fmt::format("The campaign {}: {} of {} {} {} done",
                                       review.is_cancelled ? "was cancelled" : "is not finished",
                                       num_done, num_wanted, unit_of(review), be(num_done))
                         : fmt::format("{}{} {} {} done", num_wanted == 1 ? "1 of " : "All ",
                                       num_wanted, unit_of(review), be(num_wanted));
  if (num_missing > 0) {
    text += fmt::format(", {} of them without an estimate ({}), which {} as {}", num_missing,
                        reasons_text(review.results.missing), num_missing == 1 ? "counts" : "count",
                        num_missing == 1 ? "an exceedance" : "exceedances");
  }
  return text + ".";
}

std::string verdicts(const Review& review) {
  if (!review.why_not_independent.empty()) {
    return fmt::format("There is no verdict: {}.", review.why_not_independent);
  }
  if (review.matrix.empty()) return "There is no verdict.";
  std::vector<std::string> parts;
  for (const RequirementVerdict verdict :
       {RequirementVerdict::met, RequirementVerdict::not_met, RequirementVerdict::undecided}) {
    std::vector<std::string> names;
    for (const RequirementAnswer& row : review.matrix) {
      if (row.check.verdict == verdict) names.push_back(requirement_name(row));
    }
    if (names.empty()) continue;
    parts.push_back(fmt::format("{} {} {}", names.size(), be(names.size()), name_of(verdict)));
    if (verdict != RequirementVerdict::met) parts.back() += fmt::format(" ({})", list_of(names));
  }
  std::vector<std::string> opposed;
  for (const RequirementAnswer& row : review.matrix) {
    if (row.is_opposed()) opposed.push_back(requirement_name(row));
  }
  return fmt::format(
      "Of {}, {}.{}{}", counted(review.matrix.size(), "requirement"), fmt::join(parts, ", "),
      opposed.empty() ? "" : fmt::format(" All runs together speak against {}.", list_of(opposed)),
      review.num_contradicting > 0 ? fmt::format(" Note: {}.", review.note) : "");
}

/// The quantity whose worst error is the largest beside its objective.
std::optional<std::size_t> worst_quantity(const Review& review) {
  std::optional<std::size_t> worst;
  const auto ratio = [&](std::size_t i) {
    return review.results.statistics.accuracy[i].worst / review.objectives[i];
  };
  for (std::size_t i = 0; i < review.objectives.size(); ++i) {
    if (std::isfinite(review.objectives[i]) && (!worst || ratio(i) > ratio(*worst))) worst = i;
  }
  return worst;
}

/// More of the worst error than half is what all runs share: then no draw explains it. Of errors
/// without a bias chance alone makes such a mean of two in 22 % of campaigns, of three in 7 %.
bool is_mostly_bias(const Review& review, std::size_t quantity) {
  const AccuracyStatistic& accuracy = review.results.statistics.accuracy[quantity];
  const double bias = std::abs(accuracy.error.bias);
  return bias > 0.5 * accuracy.worst && bias > 2.0 * accuracy.error.standard_deviation &&
         is_biased(review, quantity);
}

std::string driver_of(const Review& review, std::size_t quantity) {
  const AccuracyStatistic& accuracy = review.results.statistics.accuracy[quantity];
  if (is_mostly_bias(review, quantity)) {
    return fmt::format(
        "most of it is a bias that all runs share, {} with a standard deviation of {}, which "
        "follows from the campaign and not from its draws",
        quantity_text(accuracy.error.bias, review.schema.quantities[quantity]),
        quantity_text(accuracy.error.standard_deviation, review.schema.quantities[quantity]));
  }
  if (!review.why_not_independent.empty()) {
    return "what drives it is not sought, as that needs independent draws";
  }
  const std::optional<Causes>& causes = review.causes;
  if (!causes) return "what drives it is not known, as fewer than 16 draws have an estimate";
  const auto term = std::ranges::find(causes->terms, quantity, &CauseTerm::quantity);
  if (term == causes->terms.end()) {
    return fmt::format(
        "in {} draws no drawn quantity or product of two was found to explain it; whether any "
        "changes its size, `proofmass sensitivity` tells",
        causes->num_runs);
  }
  return fmt::format("of the variance of this error over the draws, {} % goes with {}",
                     figure_text(100.0 * term->found.share), term->name);
}

SummarySentence worst_error(const Review& review) {
  const CampaignStatistics& statistics = review.results.statistics;
  if (statistics.num_estimated == 0) {
    return {"No draw has an estimate, so that there is no worst error.", "Accuracy"};
  }
  const std::optional<std::size_t> worst = worst_quantity(review);
  if (!worst) return {"No parameter has an objective to hold its worst error against.", "Accuracy"};
  const Quantity& quantity = review.schema.quantities[*worst];
  const AccuracyStatistic& accuracy = statistics.accuracy[*worst];
  return {fmt::format("The worst error is that of {} in run {}, {} or {} of its objective; {}.",
                      quantity.symbol, accuracy.worst_run.value,
                      quantity_text(accuracy.worst, quantity),
                      figure_text(100.0 * accuracy.worst / review.objectives[*worst]) + " %",
                      driver_of(review, *worst)),
          review.causes && !review.causes->terms.empty() ? "Causes of the errors" : "Accuracy"};
}

SummarySentence consequence(const Review& review) {
  if (!review.budget) return {"The model has no budget that the errors would enter.", "Accuracy"};
  // `Budget of the test of ..., m/s²`.
  const std::string_view title = review.budget->title;
  const std::string budget = fmt::format("b{}", title.substr(1, title.find(',') - 1));
  const BudgetColumns columns = budget_columns(*review.budget, review.results.statistics);
  const std::string before = figure_text(columns.before.total);
  const std::optional<RunTotals>& totals = review.results.totals;
  if (!totals) {
    return {
        fmt::format("The {} is {} m/s² before calibration; what is left after it cannot be told "
                    "without an estimate.",
                    budget, before),
        "Budget"};
  }
  const CampaignStatistics& statistics = review.results.statistics;
  const bool is_of_all = statistics.num_estimated == statistics.num_runs;
  const std::string those =
      is_of_all ? std::string(unit_of(review))
                : fmt::format("{} {} with an estimate", statistics.num_estimated, unit_of(review));
  return {fmt::format("Calibration takes the {} from {} m/s² to at most {} m/s² in half of the "
                      "{}, {} m/s² in 95 % of them, and {} m/s² in the worst, run {}.",
                      budget, before, figure_text(totals->median), those,
                      figure_text(totals->percentile_95), figure_text(totals->worst),
                      totals->worst_run.value),
          "Budget"};
}

}  // namespace

std::vector<SummarySentence> review_summary(const Review& review) {
  return {{question(review), "Verification matrix"},
          {draws(review), "How it was run"},
          {verdicts(review), "Verification matrix"},
          worst_error(review),
          consequence(review)};
}

}  // namespace proofmass::coordinator
