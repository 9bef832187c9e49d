#include "coordinator/report/review_html.hpp"

#include <fmt/format.h>

#include <string_view>

#include "coordinator/charts/svg.hpp"
#include "coordinator/report/html_table.hpp"
#include "coordinator/report/review_charts.hpp"
#include "coordinator/report/review_tables.hpp"
#include "core/model.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

using wire::markup_text;

// A page may neither load nor run anything, whatever its texts hold.
constexpr std::string_view policy =
    "default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'";

constexpr std::string_view page_style =
    R"(*{box-sizing:border-box}
body{margin:0;background:var(--chart-ground);color:var(--chart-text)}
body{font:16px/1.5 system-ui,"Noto Sans","DejaVu Sans",sans-serif}
header,main,footer{padding:0 1rem;max-width:90rem;margin:0 auto}
h1{font-size:1.6rem;line-height:1.25;margin:1rem 0 .3rem;overflow-wrap:anywhere}
h2{font-size:1.3rem;margin:2rem 0 .5rem;border-bottom:2px solid var(--chart-first)}
h3{font-size:1.05rem;margin:1.4rem 0 .3rem}
a{color:inherit}
nav ul{display:flex;flex-wrap:wrap;gap:.2rem 1rem;padding:0;margin:.5rem 0;list-style:none}
p{max-width:48rem}
td.words{overflow-wrap:anywhere;min-width:6rem}
#matrix{font-size:.8rem}
#matrix th,#matrix td{padding:.2rem .4rem}
#matrix td:nth-child(2){min-width:13rem}
#matrix td:last-child{min-width:14rem}
.skip{position:absolute;left:-99rem}
.skip:focus{position:static}
@page{size:A4 landscape;margin:12mm}
@media print{
body{font-size:10pt}
nav,.skip{display:none}
.scroll{overflow:visible}
table{font-size:7pt}
th,td{padding:.1rem .25rem}
td{white-space:normal}
#matrix td:nth-child(2),#matrix td:last-child{min-width:8rem}
section{break-before:page}
section:first-of-type{break-before:auto}
figure,tr{break-inside:avoid}
.charts{grid-template-columns:1fr 1fr 1fr}
.wide svg{min-width:0}
}
)";

struct Section {
  std::string id;
  std::string title;
  std::string content;  ///< Markup; a section without any is left out.
};

std::string figure_of(const Picture& picture) {
  return "<figure>\n" + svg_of(picture, SvgUse::embedded) + "</figure>\n";
}

/// A chart that is wider than a phone scrolls.
std::string wide_figure_of(const HeatMap& map) {
  return fmt::format(
      "<div class=\"scroll wide\" role=\"region\" aria-label=\"{}\" tabindex=\"0\">\n{}</div>\n",
      markup_text(map.text.title), figure_of(map));
}

std::string table_or_nothing(const ReviewTable& table) {
  return table.rows.empty() ? "" : html_table(table);
}

std::string error_figures_markup(const Review& review) {
  std::string html =
      "<div class=\"overview\">\n" + figure_of(magnitude_overview(review)) + "</div>\n";
  const std::vector<Quantity>& quantities = model().results().quantities;
  for (std::size_t i = 0; i < quantities.size(); ++i) {
    html += fmt::format("<h3>{}</h3>\n<div class=\"charts\">\n{}{}{}</div>\n",
                        markup_text(quantities[i].symbol), figure_of(magnitude_chart(review, i)),
                        figure_of(error_chart(review, i)), figure_of(convergence_chart(review, i)));
  }
  return html;
}

std::string characteristics_markup(const Review& review) {
  std::string html;
  for (const Chart& chart : characteristic_charts(review)) html += figure_of(chart);
  if (html.empty()) return "";
  return fmt::format(
      "<p>How probable it is that a campaign of as many draws meets a requirement ({}), if that "
      "part of all draws exceeds its limit. A steep curve tells good instruments from bad ones; "
      "more draws make it steeper.</p>\n<div class=\"charts\">\n{}</div>\n",
      name_of(review.interpretation), html);
}

std::string budget_markup(const Review& review) {
  const std::optional<BarChart> chart = budget_chart(review);
  if (!chart) return "";
  return "<div class=\"single\">\n" + figure_of(*chart) + "</div>\n" +
         html_table(review_budget_table(review));
}

std::string causes_markup(const Review& review) {
  if (!review.causes) return "";
  std::string html;
  if (const std::optional<HeatMap> map = cause_map(review)) {
    html =
        "<p>Rows are drawn quantities, true parameters and products of two of them; columns are "
        "the errors with their signs. Cells below four standard errors are empty.</p>\n" +
        wide_figure_of(*map);
  }
  return html + table_or_nothing(cause_table(review));
}

std::string spectra_markup(const Review& review) {
  if (!review.spectra) return "";
  const RunSpectra& spectra = *review.spectra;
  std::string html;
  for (const std::string& reason : spectra.reasons) {
    html += fmt::format("<p>{}</p>\n", markup_text(reason));
  }
  if (spectra.sessions.empty()) return html;
  html += fmt::format(
      "<p>Run {} has the largest error of all runs beside its objective. It was simulated again, "
      "bit "
      "for bit. Without the fitted lines, noise is left, and lines that the session does not fit. "
      "{}</p>\n<div class=\"charts\">\n",
      spectra.run.value, markup_text(spectra.sessions.front().noise_meaning));
  for (const Chart& chart : spectrum_charts(spectra)) html += figure_of(chart);
  return html + "</div>\n" + html_table(spectrum_table(spectra));
}

std::string execution_markup(const Review& review) {
  std::string html = html_table(identity_table(review)) + html_table(execution_table(review)) +
                     table_or_nothing(host_table(review)) + "<h3>How to reproduce it</h3>\n<ul>\n";
  for (const auto& [command, effect] : reproducing_commands(review)) {
    html += fmt::format("<li><code>{}</code> {}</li>\n", markup_text(command), markup_text(effect));
  }
  return html + "</ul>\n";
}

std::vector<Section> sections_of(const Review& review) {
  return {{"verification", "Verification matrix", html_table(matrix_table(review))},
          {"results", "Accuracy",
           html_table(review_accuracy_table(review)) + table_or_nothing(inference_table(review))},
          {"distributions", "Errors by parameter", error_figures_markup(review)},
          {"characteristics", "Operating characteristics", characteristics_markup(review)},
          {"budget-section", "Budget", budget_markup(review)},
          {"causes-section", "Causes of the errors", causes_markup(review)},
          {"spectra-section", "Spectra of the worst run", spectra_markup(review)},
          {"how", "How it was run", execution_markup(review)}};
}

std::string heading_markup(const Review& review) {
  const CampaignStatistics& statistics = review.results.statistics;
  std::string html = fmt::format(
      "<h1>Campaign {}</h1>\n<p>{} of {} runs are finished, {} of them with an "
      "estimate. Seed {}, model {}.</p>\n",
      markup_text(review.identity.name), statistics.num_runs, review.identity.num_runs,
      statistics.num_estimated, review.identity.seed, markup_text(review.identity.model_version));
  if (statistics.num_runs + review.num_given_up < review.identity.num_runs) {
    html +=
        "<p><strong>The campaign is not finished: all figures are of the runs so "
        "far.</strong></p>\n";
  }
  return html;
}

}  // namespace

std::string review_html(const Review& review) {
  std::string navigation;
  std::string content;
  for (const Section& section : sections_of(review)) {
    if (section.content.empty()) continue;
    navigation += fmt::format("<li><a href=\"#{}\">{}</a></li>\n", section.id, section.title);
    content += fmt::format(
        "<section id=\"{0}\" aria-labelledby=\"{0}-title\">\n<h2 "
        "id=\"{0}-title\">{1}</h2>\n{2}</section>\n",
        section.id, section.title, section.content);
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
      policy, markup_text(review.identity.name), review_style(), page_style, heading_markup(review),
      navigation, content, markup_text(review.database));
}

}  // namespace proofmass::coordinator
