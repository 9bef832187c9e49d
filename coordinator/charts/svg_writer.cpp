#include "coordinator/charts/svg_writer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "core/error.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
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
  if (use_ == SvgUse::plain) return std::string(found->light);
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
