#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <regex>
#include <span>
#include <string>
#include <string_view>

#include "coordinator/charts/chart.hpp"
#include "coordinator/charts/plot.hpp"
#include "coordinator/table/table.hpp"
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
// one these are the darker half of the palette. In the order of Ink.
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

std::string svg_of(const Picture& picture, SvgUse use) {
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
  if (use == SvgUse::file) svg.rectangle({0.0, 0.0, width, height}, svg.colour(Ink::ground));
  svg.raw(body.markup());
  const std::string markup = svg.markup() + "</svg>\n";
  static const std::regex with_light_colour("var\\(--[a-z-]+,(#[0-9a-f]+)\\)");
  return use == SvgUse::file ? std::regex_replace(markup, with_light_colour, "$1") : markup;
}

namespace {

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
  const std::string text = without_end_zeros(fmt::format("{:.2f}", value));
  return text == "-0" ? "0" : text;
}

double text_width(std::string_view text) {
  constexpr double width_of_letter = 0.58;
  return width_of_letter * text_size * static_cast<double>(wire::display_width(text));
}

std::string SvgWriter::colour(Ink ink) const {
  const ThemeColour& colour = colours.at(static_cast<std::size_t>(ink));
  return fmt::format("var({},{})", colour.property, colour.light);
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

void SvgWriter::rectangle(const Box& box, std::string_view fill, double opacity,
                          const std::optional<Stroke>& stroke) {
  markup_ += fmt::format("<rect{} fill=\"{}\"{}{}/>\n", box_attributes(box), fill,
                         opacity_attribute(opacity), stroke ? stroke_attributes(*stroke) : "");
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
                  stroke_attributes({.colour = colour(Ink::ground), .width = 1.0}));
}

void SvgWriter::begin_group(std::string_view tooltip) {
  markup_ += fmt::format("<g><title>{}</title>", wire::markup_text(tooltip));
}

namespace {

constexpr std::array mantissas{1.0, 2.0, 5.0};
constexpr std::string_view minus_sign = "\u2212";

/// Correctly rounded, also where it is subnormal: std::pow is not the same on every machine.
double power_of_ten(int exponent) {
  return std::strtod(fmt::format("1e{}", exponent).c_str(), nullptr);
}

/// The largest k with 10ᵏ ≤ value. @pre value > 0 and finite.
int decade_of(double value) {
  int decade = static_cast<int>(std::floor(std::log10(value)));
  if (power_of_ten(decade) > value) --decade;
  if (power_of_ten(decade + 1) <= value) ++decade;
  return decade;
}

std::string with_minus(std::string_view text) {
  return text.starts_with('-') ? std::string(minus_sign) + std::string(text.substr(1))
                               : std::string(text);
}

std::string superscript(int number) {
  constexpr std::array<std::string_view, 10> digits{"⁰", "¹", "²", "³", "⁴",
                                                    "⁵", "⁶", "⁷", "⁸", "⁹"};
  std::string text = number < 0 ? "⁻" : "";
  for (const char digit : std::to_string(std::abs(number))) {
    text += digits.at(static_cast<std::size_t>(digit - '0'));
  }
  return text;
}

std::string with_exponent(std::string_view mantissa, int exponent) {
  const std::string power = "10" + superscript(exponent);
  if (mantissa == "1") return power;
  if (mantissa == "-1") return std::string(minus_sign) + power;
  return with_minus(mantissa) + "×" + power;
}

/// Of `{:.Ne}`, without zeros that say nothing.
std::string from_scientific(const std::string& text) {
  const std::size_t e = text.find('e');
  return with_exponent(without_end_zeros(text.substr(0, e)), std::stoi(text.substr(e + 1)));
}

/// The label of a multiple of a step, whose last digit counts.
std::string tick_label(double value, double step) {
  if (value == 0.0) return "0";
  const int last_digit = decade_of(step);
  const int first_digit = decade_of(std::abs(value));
  if (first_digit >= 5 || last_digit < -3) {
    const int num_decimals = std::clamp(first_digit - last_digit, 0, 15);
    return from_scientific(fmt::format("{:.{}e}", value, num_decimals));
  }
  return with_minus(fmt::format("{:.{}f}", value, std::max(-last_digit, 0)));
}

/// A step, as a whole multiple of a power of ten, so that multiples are rounded once.
struct Step {
  double mantissa = 1.0;
  int exponent = 0;

  [[nodiscard]] double times(double count) const {
    // A power of ten below 1 is no double, its inverse is one.
    return exponent < 0 ? count * mantissa / power_of_ten(-exponent)
                        : count * mantissa * power_of_ten(exponent);
  }
  [[nodiscard]] double size() const { return times(1.0); }
};

// Ends that lack their tick by a rounding error have it.
constexpr double tolerance = 1e-9;

Step step_for(double from, double to, std::size_t num_ticks_max) {
  for (int exponent = decade_of((to - from) / static_cast<double>(num_ticks_max));; ++exponent) {
    for (const double mantissa : mantissas) {
      const Step step{.mantissa = mantissa, .exponent = exponent};
      const double num_steps =
          std::ceil(to / step.size() - tolerance) - std::floor(from / step.size() + tolerance);
      if (num_steps + 1.0 <= static_cast<double>(num_ticks_max)) return step;
    }
  }
}

bool is_end(const std::optional<double>& end, Scale scale) {
  return end && std::isfinite(*end) && (scale == Scale::linear || *end > 0.0);
}

/// 1, 2 or 5 times a power of ten, at `value` or next to it.
double round_outwards(double value, bool is_upper) {
  const int decade = decade_of(value);
  double result = power_of_ten(decade);
  for (const double mantissa : {2.0, 5.0, 10.0}) {
    const double next = Step{mantissa, decade}.size();
    if (is_upper) {
      if (result >= value * (1.0 - tolerance)) return result;
      result = next;
    } else if (next <= value * (1.0 + tolerance)) {
      result = next;
    }
  }
  return result;
}

void add_ticks(AxisRange& range, int decade, std::span<const double> of_decade) {
  for (const double mantissa : of_decade) {
    const double value = Step{mantissa, decade}.size();
    if (value < range.from * (1.0 - tolerance) || value > range.to * (1.0 + tolerance)) continue;
    range.ticks.push_back({value, figure_text(value)});
  }
}

}  // namespace

std::string figure_text(double value, int num_digits) {
  if (value == 0.0) return "0";
  if (!std::isfinite(value)) return fmt::format("{}", value);
  const std::string scientific = fmt::format("{:.{}e}", value, num_digits - 1);
  const int exponent = std::stoi(scientific.substr(scientific.find('e') + 1));
  if (exponent < -3 || exponent > 4) return from_scientific(scientific);
  if (exponent >= num_digits) return with_minus(fmt::format("{:.0f}", value));
  // Rounded to these digits first, and then written without an exponent.
  return with_minus(fmt::format("{:.15g}", std::stod(scientific)));
}

std::string measured_text(double value) {
  if (value == 0.0 || !std::isfinite(value)) return figure_text(value);
  const std::string scientific = fmt::format("{:.2e}", value);
  const std::size_t e = scientific.find('e');
  const int exponent = std::stoi(scientific.substr(e + 1));
  if (exponent < -3 || exponent > 4) return with_exponent(scientific.substr(0, e), exponent);
  return with_minus(fmt::format("{:.{}f}", value, std::max(0, 2 - exponent)));
}

std::string unit_text(std::string_view unit) {
  if (!unit.starts_with("1e")) return std::string(unit);
  const std::size_t end = std::min(unit.find(' '), unit.size());
  return "10" + superscript(std::stoi(std::string(unit.substr(2, end - 2)))) +
         std::string(unit.substr(end));
}

AxisRange linear_range(const ChartAxis& axis, double from, double to, std::size_t num_ticks_max) {
  const bool has_from = is_end(axis.from, Scale::linear);
  const bool has_to = is_end(axis.to, Scale::linear);
  AxisRange range{.from = has_from ? *axis.from : from, .to = has_to ? *axis.to : to};
  // Differences that a double hardly holds are no range either.
  const double least = std::max(std::abs(range.from), std::abs(range.to)) * 1e-12;
  if (!(range.to - range.from > least)) {
    const double half = range.from == 0.0 ? 1.0 : std::abs(range.from);
    if (!has_to) range.to += half;
    if (!has_from && !axis.is_count) range.from -= half;
  }
  Step step = step_for(range.from, range.to, num_ticks_max);
  if (axis.is_count && step.size() < 1.0) step = {};
  const double size = step.size();
  if (!has_from) range.from = step.times(std::floor(range.from / size + tolerance));
  if (!has_to) range.to = step.times(std::ceil(range.to / size - tolerance));
  const double last = std::floor(range.to / size + tolerance);
  for (double count = std::ceil(range.from / size - tolerance); count <= last; count += 1.0) {
    const double value = step.times(count);
    range.ticks.push_back({value, tick_label(value, size)});
  }
  return range;
}

AxisRange logarithmic_range(const ChartAxis& axis, double from, double to,
                            std::size_t num_ticks_max) {
  AxisRange range{
      .from = is_end(axis.from, Scale::logarithmic) ? *axis.from : round_outwards(from, false),
      .to = is_end(axis.to, Scale::logarithmic) ? *axis.to : round_outwards(to, true)};
  if (!(range.to > range.from)) range.to = 10.0 * range.from;
  const int first = decade_of(range.from);
  const int last = decade_of(range.to);
  for (int decade = first; decade <= last; ++decade) add_ticks(range, decade, mantissas);
  const bool are_few_powers = range.to / range.from < 100.0;
  if (are_few_powers || range.ticks.size() <= num_ticks_max) return range;
  range.ticks.clear();
  const int stride = 1 + (last - first) / static_cast<int>(num_ticks_max);
  for (int decade = first; decade <= last; decade += range.ticks.empty() ? 1 : stride) {
    add_ticks(range, decade, std::array{1.0});
  }
  return range;
}

}  // namespace proofmass::coordinator
