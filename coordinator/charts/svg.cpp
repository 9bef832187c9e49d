#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <regex>
#include <string>

#include "coordinator/charts/chart.hpp"
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
  return fmt::format(
      "<svg {} viewBox=\"0 0 {} {}\" role=\"img\" aria-labelledby=\"{}-title {}-description\" "
      "font-family=\"system-ui,'Noto Sans','DejaVu Sans',sans-serif\" font-size=\"{}\" "
      "fill=\"var(--chart-text,#1d2228)\">\n"
      "<title id=\"{}-title\">{}</title>\n<desc id=\"{}-description\">{}</desc>\n",
      size, coordinate(width), coordinate(height), text.id, text.id, coordinate(text_size), text.id,
      wire::markup_text(text.title), text.id, wire::markup_text(text.description));
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
  SvgWriter body;
  const double height =
      2.0 * margin +
      std::visit(
          [&](const auto& chart) {
            return draw_chart(chart, Point{margin, margin}, width - 2.0 * margin, body);
          },
          picture);
  SvgWriter svg;
  svg.raw(opening(text_of(picture), use, width, height));
  if (use == SvgUse::standalone) svg.raw(standalone_style() + "\n");
  if (use != SvgUse::embedded) {
    svg.rectangle({0.0, 0.0, width, height}, svg.colour("--chart-ground"));
  }
  svg.raw(body.markup());
  const std::string markup = svg.markup() + "</svg>\n";
  static const std::regex with_light_colour("var\\(--[a-z-]+,(#[0-9a-f]+)\\)");
  return use == SvgUse::plain ? std::regex_replace(markup, with_light_colour, "$1") : markup;
}

namespace {

/// In the order of Ink.
constexpr std::array<std::string_view, 5> ink_properties{
    "--chart-first", "--chart-second", "--chart-third", "--chart-fourth", "--chart-text"};

std::string stroke_attributes(const Stroke& stroke) {
  const std::string_view dashes = stroke.dash == Dash::dashed   ? " stroke-dasharray=\"7 4\""
                                  : stroke.dash == Dash::dotted ? " stroke-dasharray=\"2 3\""
                                                                : "";
  return fmt::format(" stroke=\"{}\" stroke-width=\"{}\"{}", stroke.colour,
                     coordinate(stroke.width), dashes);
}

std::string opacity_attribute(double opacity) {
  return opacity < 1.0 ? fmt::format(" fill-opacity=\"{}\"", coordinate(opacity)) : "";
}

std::string box_attributes(const Box& box) {
  return fmt::format(" x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"", coordinate(box.left),
                     coordinate(box.top), coordinate(std::max(box.width, 0.0)),
                     coordinate(std::max(box.height, 0.0)));
}

std::string marker_path(Point centre, Shape shape) {
  constexpr double r = 4.5;
  const auto at = [&](double x, double y) {
    return coordinate(centre.x + x) + " " + coordinate(centre.y + y);
  };
  return shape == Shape::triangle
             ? fmt::format("M{}L{}L{}Z", at(0.0, -r), at(r, r), at(-r, r))
             : fmt::format("M{}L{}L{}L{}Z", at(0.0, -r), at(r, 0.0), at(0.0, r), at(-r, 0.0));
}

}  // namespace

std::string coordinate(double value) {
  std::string text = fmt::format("{:.2f}", value);
  while (text.ends_with('0')) text.pop_back();
  if (text.ends_with('.')) text.pop_back();
  return text == "-0" ? "0" : text;
}

double text_width(std::string_view text) {
  constexpr double width_of_letter = 0.58;
  return width_of_letter * text_size * static_cast<double>(wire::display_width(text));
}

std::string SvgWriter::colour(std::string_view property) const {
  const auto found = std::ranges::find(theme_colours(), property, &ThemeColour::property);
  PROOFMASS_EXPECT(found != theme_colours().end());
  return fmt::format("var({},{})", property, found->light);
}

std::string SvgWriter::colour(Ink ink) const {
  return colour(ink_properties.at(static_cast<std::size_t>(ink)));
}

void SvgWriter::text(Point place, std::string_view text, const TextStyle& style) {
  constexpr std::array<std::string_view, 3> anchors{"", " text-anchor=\"middle\"",
                                                    " text-anchor=\"end\""};
  const std::string rotation =
      style.rotation == 0.0
          ? ""
          : fmt::format(" transform=\"rotate({} {} {})\"", coordinate(style.rotation),
                        coordinate(place.x), coordinate(place.y));
  markup_ +=
      fmt::format("<text x=\"{}\" y=\"{}\"{}{}{}>{}</text>\n", coordinate(place.x),
                  coordinate(place.y), anchors.at(static_cast<std::size_t>(style.anchor)),
                  style.is_bold ? " font-weight=\"600\"" : "", rotation, wire::markup_text(text));
}

void SvgWriter::rectangle(const Box& box, std::string_view fill) {
  markup_ += fmt::format("<rect{} fill=\"{}\"/>\n", box_attributes(box), fill);
}

void SvgWriter::outlined_rectangle(const Box& box, std::string_view fill, double opacity,
                                   const Stroke& stroke) {
  markup_ += fmt::format("<rect{} fill=\"{}\"{}{}/>\n", box_attributes(box), fill,
                         opacity_attribute(opacity), stroke_attributes(stroke));
}

void SvgWriter::line(Point from, Point to, const Stroke& stroke) {
  outline(fmt::format("M{} {}L{} {}", coordinate(from.x), coordinate(from.y), coordinate(to.x),
                      coordinate(to.y)),
          stroke);
}

void SvgWriter::outline(std::string_view path, const Stroke& stroke) {
  markup_ += fmt::format("<path d=\"{}\" fill=\"none\"{}/>\n", path, stroke_attributes(stroke));
}

void SvgWriter::area(std::string_view path, std::string_view fill, double opacity) {
  markup_ +=
      fmt::format("<path d=\"{}\" fill=\"{}\"{}/>\n", path, fill, opacity_attribute(opacity));
}

void SvgWriter::marker(Point centre, Shape shape, Ink ink) {
  markup_ +=
      fmt::format("<path d=\"{}\" fill=\"{}\"{}/>\n", marker_path(centre, shape), colour(ink),
                  stroke_attributes({.colour = colour("--chart-ground"), .width = 1.0}));
}

void SvgWriter::begin_group(std::string_view tooltip) {
  markup_ += fmt::format("<g><title>{}</title>", wire::markup_text(tooltip));
}

}  // namespace proofmass::coordinator
