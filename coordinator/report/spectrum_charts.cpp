#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "coordinator/charts/ticks.hpp"
#include "coordinator/report/review_charts.hpp"
#include "coordinator/report/review_tables.hpp"

namespace proofmass::coordinator {
namespace {

std::string ratio_text(const NoiseRatio& ratio) {
  return fmt::format("{:.2f} ± {:.2f}", ratio.value, ratio.standard_error);
}

Line line_of(const SessionSpectrum& spectrum, std::string name, double SpectrumPoint::*density,
             Ink ink, Dash dash) {
  Line line{.name = std::move(name), .points = {}, .ink = ink, .dash = dash};
  for (const SpectrumPoint& point : spectrum.points) {
    line.points.push_back({point.frequency_hz, point.*density});
  }
  return line;
}

Markers line_markers(const SessionSpectrum& spectrum, bool is_used, std::string name, Ink ink,
                     Shape shape) {
  Markers markers{.name = {}, .points = {}, .labels = {}, .ink = ink, .shape = shape};
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

Chart spectrum_chart(const SessionSpectrum& spectrum, RunIndex run) {
  return {
      .text = {.id = "spectrum-" + spectrum.session,
               .title = fmt::format("{}: {}", name_in_symbols(spectrum.session), spectrum.meaning),
               .description = spectrum_description(spectrum, run)},
      .x = {.label = "frequency, Hz", .scale = Scale::logarithmic},
      .y = {.label = fmt::format("{}/√Hz", spectrum.unit), .scale = Scale::logarithmic},
      .layers = {
          line_of(spectrum, "measured", &SpectrumPoint::measured, Ink::first, Dash::solid),
          line_of(spectrum, "without fitted lines", &SpectrumPoint::residual, Ink::third,
                  Dash::solid),
          line_of(spectrum, "noise model", &SpectrumPoint::expected, Ink::text, Dash::dashed),
          line_markers(spectrum, true, "line of the estimate", Ink::fourth, Shape::diamond),
          line_markers(spectrum, false, "other fitted line", Ink::second, Shape::triangle)}};
}

/// A line of the estimate, and the noise about it.
Row line_cells(const SessionSpectrum& spectrum, const SpectrumLine& line) {
  const auto& ratio = spectrum.noise_ratio;
  return {name_in_symbols(spectrum.session),
          {figure_text(1e3 * line.frequency_hz), line.frequency_hz},
          {figure_text(line.amplitude), line.amplitude},
          spectrum.unit,
          ratio ? Cell(ratio_text(*ratio), ratio->value) : Cell("–")};
}

}  // namespace

std::vector<Chart> spectrum_charts(const RunSpectra& spectra) {
  std::vector<Chart> charts;
  for (const SessionSpectrum& spectrum : spectra.sessions) {
    charts.push_back(spectrum_chart(spectrum, spectra.run));
  }
  return charts;
}

std::string spectrum_name(std::string_view session) { return fmt::format("spectrum:{}", session); }

Table spectrum_table(const RunSpectra& spectra) {
  Table table{.id = "spectra",
              .caption = fmt::format("Lines that the estimates of run {} use", spectra.run.value),
              .columns = {{"session", true},
                          {"frequency, mHz"},
                          {"amplitude"},
                          {"unit", true},
                          {"noise power ÷ model"}},
              .notes = {"Noise power: from the median of all frequencies up to a factor of three "
                        "from these lines, without what is within two bins of a fitted line, ± its "
                        "standard error."}};
  for (const SessionSpectrum& spectrum : spectra.sessions) {
    for (const SpectrumLine& line : spectrum.lines) {
      if (line.is_used) table.rows.push_back(line_cells(spectrum, line));
    }
  }
  return table;
}

}  // namespace proofmass::coordinator
