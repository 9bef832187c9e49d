#include "coordinator/charts/svg.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <regex>
#include <string>

#include "coordinator/charts/plot.hpp"
#include "core/error.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

constexpr double margin = 6.0;
constexpr double picture_width = 480.0;
constexpr double timeline_width = 900.0;
constexpr double embedded_scale = 440.0 / picture_width;

double width_of_picture(const Picture& picture) {
  if (std::holds_alternative<Timeline>(picture)) return timeline_width;
  const auto* map = std::get_if<HeatMap>(&picture);
  return map == nullptr ? picture_width : std::max(picture_width, width_of(*map) + 2.0 * margin);
}

void check_id(const ChartText& text) {
  static const std::regex rule("[A-Za-z][A-Za-z0-9_-]{0,199}");
  PROOFMASS_EXPECT(std::regex_match(text.id, rule));
}

void check_ids(const Picture& picture) {
  check_id(text_of(picture));
  if (const auto* grid = std::get_if<ChartGrid>(&picture)) {
    for (const Chart& chart : grid->charts) check_id(chart.text);
  }
}

std::string opening(const ChartText& text, SvgUse use, double width, double height) {
  const std::string size =
      use == SvgUse::embedded
          ? fmt::format("width=\"{}\"", coordinate(embedded_scale * width))
          : fmt::format("xmlns=\"http://www.w3.org/2000/svg\" width=\"{}\" height=\"{}\"",
                        coordinate(width), coordinate(height));
  const std::string_view fill = use == SvgUse::plain ? "#1d2228" : "var(--chart-text,#1d2228)";
  return fmt::format(
      "<svg {} viewBox=\"0 0 {} {}\" role=\"img\" aria-labelledby=\"{}-title {}-description\" "
      "font-family=\"system-ui,'Noto Sans','DejaVu Sans',sans-serif\" font-size=\"{}\" "
      "fill=\"{}\">\n"
      "<title id=\"{}-title\">{}</title>\n<desc id=\"{}-description\">{}</desc>\n",
      size, coordinate(width), coordinate(height), text.id, text.id, coordinate(text_size), fill,
      text.id, wire::markup_text(text.title), text.id, wire::markup_text(text.description));
}

}  // namespace

const ChartText& text_of(const Picture& picture) {
  return std::visit([](const auto& chart) -> const ChartText& { return chart.text; }, picture);
}

namespace {

// The first inks are those of Okabe and Ito that differ from either ground by 3:1; on the light
// one these are the darker half of the palette.
constexpr std::array<ThemeColour, 7> colours{{{"--chart-ground", "#ffffff", "#14171c"},
                                              {"--chart-text", "#1d2228", "#e8eaed"},
                                              {"--chart-grid", "#d7dbe0", "#3a4048"},
                                              {"--chart-first", "#0072b2", "#56b4e9"},
                                              {"--chart-second", "#d55e00", "#e69f00"},
                                              {"--chart-third", "#008f68", "#009e73"},
                                              {"--chart-fourth", "#b0568a", "#cc79a7"}}};

std::string declarations(std::string_view ThemeColour::*ground) {
  std::string text;
  for (const ThemeColour& colour : colours) {
    text += fmt::format("{}:{};", colour.property, colour.*ground);
  }
  return text;
}

}  // namespace

std::span<const ThemeColour> theme_colours() { return colours; }

std::string light_colours() { return declarations(&ThemeColour::light); }

std::string dark_colours() { return declarations(&ThemeColour::dark); }

namespace {

/// Light, and dark for readers who prefer that.
std::string standalone_style() {
  return fmt::format(
      "<style>svg{{{}}}@media (prefers-color-scheme:dark){{svg{{{}}}}}"
      "@media print{{svg{{{}}}}}</style>",
      light_colours(), dark_colours(), light_colours());
}

}  // namespace

std::string svg_of(const Picture& picture, SvgUse use) {
  check_ids(picture);
  const double width = width_of_picture(picture);
  SvgWriter body(use);
  const double height =
      2.0 * margin +
      std::visit(
          [&](const auto& chart) {
            return draw_chart(chart, Point{margin, margin}, width - 2.0 * margin, body);
          },
          picture);
  SvgWriter svg(use);
  svg.raw(opening(text_of(picture), use, width, height));
  if (use == SvgUse::standalone) svg.raw(standalone_style() + "\n");
  if (use != SvgUse::embedded) {
    svg.rectangle({0.0, 0.0, width, height}, svg.colour("--chart-ground"));
  }
  svg.raw(body.markup());
  return svg.markup() + "</svg>\n";
}

}  // namespace proofmass::coordinator
