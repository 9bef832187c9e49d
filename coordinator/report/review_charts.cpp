#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string_view>
#include <tuple>
#include <utility>

#include "coordinator/charts/chart.hpp"
#include "coordinator/report/report.hpp"
#include "core/statistics/distribution.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

/// P(no more of so many draws exceed than are allowed) if each does with this probability.
double probability_to_meet(const RequirementCheck& check, double exceedance_probability) {
  if (check.bound_order == 0) return 0.0;  // No number of exceedances is few enough.
  if (exceedance_probability <= 0.0) return 1.0;
  if (exceedance_probability >= 1.0) return 0.0;
  return binomial_at_most(static_cast<double>(check.bound_order - 1),
                          static_cast<double>(check.num_runs), exceedance_probability);
}

/// True if as many draws answer both with the same coverage and confidence.
bool have_same_curve(const RequirementAnswer& a, const RequirementAnswer& b) {
  const auto key = [](const RequirementAnswer& of) {
    const Tolerance& tolerance = of.requirement.tolerance;
    return std::tuple(tolerance.coverage, tolerance.confidence, of.check.num_runs);
  };
  return key(a) == key(b);
}

Curve observed_fractions(const Review& review, const RequirementAnswer& first) {
  Curve markers{.name = "seen in these draws", .ink = Ink::fourth, .look = Shape::diamond};
  for (const RequirementAnswer& row : review.matrix) {
    const RequirementCheck& check = row.check;
    if (!have_same_curve(row, first)) continue;
    const double seen =
        static_cast<double>(check.num_exceedances) / static_cast<double>(check.num_runs);
    markers.points.push_back({100.0 * seen, 100.0 * probability_to_meet(check, seen)});
  }
  return markers;
}

/// The axis ends where nearly every campaign fails, and at what was seen at the farthest.
double largest_shown(const Curve& seen, const Tolerance& tolerance) {
  double end = 4.0 * (1.0 - tolerance.coverage);
  for (const Point& percents : seen.points) end = std::max(end, 1.1 * percents.x / 100.0);
  return std::min(end, 1.0);
}

Chart characteristic_chart(const Review& review, const RequirementAnswer& first,
                           std::size_t number) {
  const Tolerance& tolerance = first.requirement.tolerance;
  const RequirementCheck& check = first.check;
  Curve seen = observed_fractions(review, first);
  const double end = largest_shown(seen, tolerance);
  constexpr int num_points = 120;
  Curve line{.name = counted(check.num_runs, "draw")};
  for (int i = 0; i <= num_points; ++i) {
    const double probability = end * i / num_points;
    line.points.push_back({100.0 * probability, 100.0 * probability_to_meet(check, probability)});
  }
  const double allowed = 1.0 - tolerance.coverage;
  return {
      .text = {.id = fmt::format("characteristic-{}", number),
               .title =
                   fmt::format("Requirements for {} with {}", given_percent(tolerance.coverage),
                               given_percent(tolerance.confidence)),
               .description = fmt::format(
                   "Probability that {} meet such a requirement, against the probability "
                   "with which a draw exceeds its limit. {} Where {} of all draws exceed it, the "
                   "requirement is called met with a probability of {} %, the consumer's risk; "
                   "where fewer do, what lacks to 100 % is the producer's risk.",
                   counted(check.num_runs, "draw"),
                   fmt::format("At most {} of them may exceed it.", check.bound_order - 1),
                   given_percent(allowed),
                   figure_text(100.0 * probability_to_meet(check, allowed)))},
      .x = {.label = "draws that exceed the limit, % of all draws", .from = 0.0, .to = 100.0 * end},
      .y = {.label = "campaigns that meet the requirement, %", .from = 0.0, .to = 100.0},
      .layers = {std::move(line),
                 LimitLine{.label = fmt::format("allowed {}", given_percent(allowed)),
                           .value = 100.0 * allowed},
                 std::move(seen)}};
}

std::string cell_label(double correlation) {
  const long hundredths = std::lround(100.0 * std::abs(correlation));
  if (hundredths >= 100) return correlation < 0.0 ? "−1" : "1";
  return fmt::format("{}.{:02}", correlation < 0.0 ? "−" : "", hundredths);
}

std::string strongest_sentence(const ResultSchema& schema, const Causes& causes) {
  std::string text;
  for (const CauseTerm& term : causes.terms) {
    if (term.found.share < 0.5) continue;
    text += fmt::format(" The error of {} is {} times {}, which explains {:.0f} % of its variance.",
                        schema.quantities[term.quantity].symbol, figure_text(term.found.slope),
                        term.name, 100.0 * term.found.share);
  }
  return text;
}

}  // namespace

std::vector<Chart> characteristic_charts(const Review& review) {
  if (!review.why_not_independent.empty()) return {};
  std::vector<Chart> charts;
  std::vector<const RequirementAnswer*> shown;
  for (const RequirementAnswer& row : review.matrix) {
    const bool is_shown = std::ranges::any_of(
        shown, [&](const RequirementAnswer* one) { return have_same_curve(*one, row); });
    if (is_shown || row.check.bound_order == 0) continue;  // So few draws never meet it.
    shown.push_back(&row);
    charts.push_back(characteristic_chart(review, row, charts.size() + 1));
  }
  return charts;
}

std::optional<BarChart> budget_chart(const Review& review) {
  if (!review.budget) return std::nullopt;
  const ErrorBudget& budget = *review.budget;
  const auto& [before, worst, mean] = budget_columns(budget, review.results.statistics);
  BarChart chart;
  chart.text = {.id = "budget",
                .title = "Budget before and after estimation",
                .description = fmt::format("{}. Before estimation the total is {}", budget.title,
                                           figure_text(before.total))};
  chart.x = {.label = "m/s²", .scale = Scale::logarithmic};
  chart.series = {{.name = "before", .ink = Ink::second}, {.name = "after, worst errors"}};
  for (std::size_t i = 0; i <= budget.terms.size(); ++i) {
    const bool is_total = i == budget.terms.size();
    const auto value_of = [&](const Budget& of) { return is_total ? of.total : of.entries[i]; };
    const BudgetEntryInfo& info = is_total ? budget.total_info : budget.terms[i].info;
    chart.categories.emplace_back(info.label);
    chart.series[0].values.emplace_back(value_of(before));
    chart.series[1].values.push_back(worst ? std::optional(value_of(*worst)) : std::nullopt);
  }
  chart.text.description +=
      worst ? fmt::format(", after it at most {} m/s².", figure_text(worst->total)) : " m/s².";
  return chart;
}

std::optional<HeatMap> cause_map(const Review& review) {
  if (!review.causes || review.causes->inputs.empty()) return std::nullopt;
  const Causes& causes = *review.causes;
  HeatMap map{.text = {.id = "causes",
                       .title = "Correlation of the errors with draws and their products",
                       .description =
                           fmt::format("Linear correlation coefficients of {} runs.{}",
                                       causes.num_runs, strongest_sentence(review.schema, causes))},
              .rows = causes.inputs};
  for (const Quantity& quantity : review.schema.quantities) {
    map.columns.emplace_back(quantity.symbol);
  }
  for (const auto& row : causes.correlations) {
    for (const std::optional<double>& value : row) {
      map.cells.push_back({.value = value, .label = value ? cell_label(*value) : ""});
    }
  }
  return map;
}

std::string review_style() {
  // The inks of the charts are for lines; text needs 4.5:1.
  constexpr std::string_view light =
      "--met:#00603f;--unmet:#a83c00;--open:#6b4a00;--heading:#f2f4f6;--faint:#566070;"
      "--warn-ground:#fff3d6;";
  constexpr std::string_view dark =
      "--met:#45c79b;--unmet:#ff9d5c;--open:#e6b84d;--heading:#1f242b;--faint:#a3adbb;"
      "--warn-ground:#3a2e10;";
  return fmt::format(
             ":root{{color-scheme:light dark;{}{}}}\n"
             "@media (prefers-color-scheme:dark){{:root{{{}{}}}}}\n"
             "@media print{{:root{{{}{}}}}}\n",
             light_colours(), light, dark_colours(), dark, light_colours(), light) +
         R"(*{box-sizing:border-box}
body{margin:0;background:var(--chart-ground);color:var(--chart-text)}
body{font:16px/1.5 system-ui,"Noto Sans","DejaVu Sans",sans-serif}
a{color:inherit}
:focus-visible{outline:3px solid var(--chart-first);outline-offset:2px}
.skip{position:absolute;left:-99rem}
.skip:focus{position:static}
h1{font-size:1.6rem;line-height:1.25;margin:1rem 0 .3rem;overflow-wrap:anywhere}
h3{font-size:1.05rem;margin:1.4rem 0 .3rem;overflow-wrap:anywhere}
p,li{text-wrap:pretty;overflow-wrap:anywhere}
.scroll{overflow-x:auto;max-width:100%;margin:.5rem 0}
.scroll{background:linear-gradient(to left,var(--chart-ground) 1rem,transparent) right/2rem 100%,
linear-gradient(to left,rgb(128 128 128/.4),transparent) right/1rem 100%}
.scroll{background-repeat:no-repeat;background-attachment:local,scroll}
table{border-collapse:collapse;font-size:.9rem;font-variant-numeric:tabular-nums}
caption{text-align:left;font-weight:600;padding:.3rem 0}
caption{position:sticky;left:0;max-width:calc(100vw - 2rem)}
th,td{padding:.25rem .6rem;text-align:right;vertical-align:top}
th,td{border-bottom:1px solid var(--chart-grid)}
thead th{vertical-align:bottom}
thead th,thead td{background:var(--heading)}
th[scope=colgroup]{text-align:center}
th.words,td.words{text-align:left}
td{white-space:nowrap}
td.words{white-space:normal;overflow-wrap:anywhere;min-width:6rem}
tbody th{font-weight:600;position:sticky;left:0;background:var(--chart-ground)}
tbody th{max-width:40vw;overflow-wrap:break-word}
.met{color:var(--met)}.unmet{color:var(--unmet)}.open{color:var(--open)}
td strong{white-space:nowrap}
.note{font-size:.9rem;margin:.3rem 0;max-width:48rem}
code{font-family:ui-monospace,monospace;font-size:.9em}
figure{margin:.5rem 0;max-width:100%}
figure svg{display:block;height:auto;max-width:100%}
.scroll figure,.scroll svg{max-width:none}
.flow{display:flex;flex-wrap:wrap;align-items:flex-start;gap:.5rem 1rem}
.flow>div{max-width:100%}
.flow>h3,.flow>p,.flow>ul{flex-basis:100%}
.flow>div>.note{width:0;min-width:100%}
)";
}

namespace {

std::string ratio_text(const NoiseRatio& ratio) {
  return fmt::format("{:.2f} ± {:.2f}", ratio.value, ratio.standard_error);
}

Curve line_of(const SessionSpectrum& spectrum, std::string name, double SpectrumPoint::*density,
              Ink ink, Dash dash) {
  Curve line{.name = std::move(name), .points = {}, .ink = ink, .look = dash};
  for (const SpectrumPoint& point : spectrum.points) {
    line.points.push_back({point.frequency_hz, point.*density});
  }
  return line;
}

Curve line_markers(const SessionSpectrum& spectrum, bool is_used, std::string name, Ink ink,
                   Shape shape) {
  Curve markers{.name = {}, .points = {}, .ink = ink, .look = shape};
  for (const SpectrumLine& line : spectrum.lines) {
    if (line.is_used == is_used) markers.points.push_back({line.frequency_hz, line.height});
  }
  if (!markers.points.empty()) markers.name = std::move(name);
  return markers;
}

std::string spectrum_description(const SessionSpectrum& spectrum, RunIndex run) {
  std::string text = fmt::format("Amplitude spectral density of {} in run {}, one-sided.",
                                 spectrum.meaning, run.value);
  for (const SpectrumLine& line : spectrum.lines) {
    if (!line.is_used) continue;
    text += fmt::format(" The line at {} Hz that the estimate uses has an amplitude of {} {}.",
                        figure_text(line.frequency_hz), figure_text(line.amplitude), spectrum.unit);
  }
  if (spectrum.noise_ratio) {
    text += fmt::format(" Near these lines the power of the noise is {} times that of its model.",
                        ratio_text(*spectrum.noise_ratio));
  }
  return text;
}

Chart spectrum_chart(const ResultSchema& schema, const SessionSpectrum& spectrum, RunIndex run) {
  Chart chart{
      .text = {.id = "spectrum-" + spectrum.session,
               .title = fmt::format("{}: {}", name_in_symbols(schema, spectrum.session),
                                    spectrum.meaning),
               .description = spectrum_description(spectrum, run)},
      .x = {.label = "frequency, Hz", .scale = Scale::logarithmic},
      .y = {.label = fmt::format("{}/√Hz", spectrum.unit), .scale = Scale::logarithmic},
      .layers = {line_of(spectrum, "measured", &SpectrumPoint::measured, Ink::first, Dash::solid),
                 line_of(spectrum, "without fitted lines", &SpectrumPoint::residual, Ink::third,
                         Dash::solid),
                 line_markers(spectrum, true, "line of the estimate", Ink::fourth, Shape::diamond),
                 line_markers(spectrum, false, "other fitted line", Ink::second, Shape::triangle)}};
  const auto is_of_noise = [](const SpectrumPoint& point) { return point.expected > 0.0; };
  if (std::ranges::any_of(spectrum.points, is_of_noise)) {
    chart.layers.emplace_back(
        line_of(spectrum, "noise model", &SpectrumPoint::expected, Ink::text, Dash::dashed));
  }
  return chart;
}

/// A line of the estimate, and the noise about it.
Row line_cells(const ResultSchema& schema, const SessionSpectrum& spectrum,
               const SpectrumLine& line) {
  const auto& ratio = spectrum.noise_ratio;
  return {name_in_symbols(schema, spectrum.session),
          {figure_text(1e3 * line.frequency_hz), line.frequency_hz},
          {figure_text(line.amplitude), line.amplitude},
          spectrum.unit,
          ratio ? Cell(ratio_text(*ratio), ratio->value) : Cell("–")};
}

Table spectrum_table(const Review& review) {
  const RunSpectra& spectra = *review.spectra;
  Table table{.id = "spectra",
              .caption = fmt::format("Lines that the estimates of run {} use", spectra.run.value),
              .columns = {{"session", true},
                          {"frequency, mHz"},
                          {"amplitude"},
                          {"unit", true},
                          {"noise power ÷ model"}},
              .notes = {"Noise power: from the median of all frequencies up to a factor of three "
                        "from these lines, without what is within two bins of a fitted line, ± its "
                        "standard error; of 16 frequencies at least."}};
  for (const SessionSpectrum& spectrum : spectra.sessions) {
    for (const SpectrumLine& line : spectrum.lines) {
      if (line.is_used) table.rows.push_back(line_cells(review.schema, spectrum, line));
    }
  }
  return table;
}

}  // namespace

std::string spectrum_name(std::string_view session) { return fmt::format("spectrum:{}", session); }

std::vector<Part> spectrum_parts(const Review& review) {
  std::vector<Part> parts;
  if (!review.spectra) return parts;
  const RunSpectra& spectra = *review.spectra;
  for (const std::string& reason : spectra.reasons) {
    parts.emplace_back(Markup{fmt::format("<p>{}</p>\n", wire::markup_text(reason))});
  }
  if (spectra.sessions.empty()) return parts;
  parts.emplace_back(Markup{fmt::format(
      "<p>Run {} has the largest error of all runs beside its objective. It was simulated again, "
      "bit for bit. Without the fitted lines, noise is left, if there is any, and lines that the "
      "session does not fit. {}</p>\n",
      spectra.run.value, wire::markup_text(spectra.sessions.front().noise_meaning))});
  for (const SessionSpectrum& spectrum : spectra.sessions) {
    parts.emplace_back(NamedPicture{spectrum_name(spectrum.session),
                                    spectrum_chart(review.schema, spectrum, spectra.run)});
  }
  parts.emplace_back(spectrum_table(review));
  return parts;
}

}  // namespace proofmass::coordinator
