#include "coordinator/charts/plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "coordinator/table/table.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

struct Extents {
  Extent x;
  Extent y;

  void add(const Bars& bars) {
    for (const double edge : bars.edges) x.add(edge);
    for (const double height : bars.heights) y.add(height);
    y.add(0.0);
  }
  void add(const Curve& curve) {
    for (const Point& point : curve.points) add(point);
  }
  void add(const Band& band) {
    for (const BandPoint& point : band.points) {
      add(Point{point.x, point.lower});
      y.add(point.upper);
    }
  }
  void add(const LimitLine& limit) { x.add(limit.value); }
  void add(const Point& point) {
    x.add(point.x);
    y.add(point.y);
  }
};

struct PlotArea {
  AxisMap x;
  AxisMap y;
  Box box;
};

Extents extents_of(const Chart& chart) {
  Extents extents{Extent(chart.x.scale), Extent(chart.y.scale)};
  for (const Layer& layer : chart.layers) {
    std::visit([&](const auto& shown) { extents.add(shown); }, layer);
  }
  return extents;
}

LegendEntry entry_of(const Bars& bars) { return {.name = bars.name, .ink = bars.ink}; }
LegendEntry entry_of(const Curve& curve) {
  LegendEntry entry{.name = curve.name, .ink = curve.ink};
  std::visit([&](const auto look) { entry.look = look; }, curve.look);
  return entry;
}
LegendEntry entry_of(const Band& band) {
  return {.name = band.name, .ink = band.ink, .look = 0.25};
}
LegendEntry entry_of(const LimitLine&) { return {}; }  // It has its label.

std::size_t num_bars(const Bars& bars) {
  return std::min(bars.heights.size(), bars.edges.empty() ? 0 : bars.edges.size() - 1);
}

/// Whether there is something to see of a layer between the axes.
bool is_seen(const Bars& bars, const PlotArea& area) {
  for (std::size_t i = 0; i < num_bars(bars); ++i) {
    if (bars.heights[i] > 0.0 && bars.edges[i + 1] >= area.x.range.from &&
        bars.edges[i] <= area.x.range.to) {
      return true;
    }
  }
  return false;
}
bool is_seen(const Curve& curve, const PlotArea& area) {
  return std::ranges::any_of(curve.points, [&](const Point& point) {
    return area.x.contains(point.x) && area.y.contains(point.y);
  });
}
bool is_seen(const Band& band, const PlotArea&) { return band.points.size() > 1; }
bool is_seen(const LimitLine&, const PlotArea&) { return false; }  // It is no data.

bool is_seen(const Layer& layer, const PlotArea& area) {
  return std::visit([&](const auto& shown) { return is_seen(shown, area); }, layer);
}

std::vector<LegendEntry> legend_of(const Chart& chart, const PlotArea& area) {
  std::vector<LegendEntry> entries;
  for (const Layer& layer : chart.layers) {
    if (!is_seen(layer, area)) continue;
    std::visit([&](const auto& shown) { entries.push_back(entry_of(shown)); }, layer);
  }
  std::erase_if(entries, [](const LegendEntry& entry) { return entry.name.empty(); });
  return entries;
}

std::vector<const LimitLine*> vertical_limits(const Chart& chart, const AxisMap& x) {
  std::vector<const LimitLine*> limits;
  for (const Layer& layer : chart.layers) {
    const auto* limit = std::get_if<LimitLine>(&layer);
    if (limit == nullptr || limit->label.empty() || !x.contains(limit->value)) continue;
    limits.push_back(limit);
  }
  return limits;
}

constexpr double limit_row_height = 18.0;

/// Labels of vertical lines stand one below the other above the box, each with a line down to it.
void draw_limit_labels(std::span<const LimitLine* const> limits, const AxisMap& x, const Box& box,
                       SvgWriter& writer) {
  double row = static_cast<double>(limits.size());
  for (const LimitLine* limit : limits) {
    const double baseline = box.top - limit_row_height * row + 9.0;
    const double at = x.at(limit->value);
    const bool is_left = at < box.left + 0.5 * box.width;
    writer.line({at, baseline - 10.0}, {at, box.top},
                {.colour = writer.colour(limit->ink), .width = 2.0, .dash = limit->dash});
    writer.text({at + (is_left ? 5.0 : -5.0), baseline}, limit->label,
                {.anchor = is_left ? Anchor::start : Anchor::end});
    row -= 1.0;
  }
}

std::size_t num_ticks_for(double length, double least) {
  return static_cast<std::size_t>(std::clamp(length / least, 2.0, 8.0));
}

/// Half of a number's width, whose digits and signs are wider than the mean letter: `−5×10⁵` by 15
/// %.
double half_width(const std::string& label) { return 0.58 * text_width(label); }

double label_margin(const AxisRange& range) {
  double width = 20.0;
  for (const Tick& tick : range.ticks) width = std::max(width, text_width(tick.label));
  return width + 10.0;
}

/// Grid lines and labels of ticks on the left of the box; the label is not drawn.
void draw_y_axis(const AxisMap& y, const Box& box, SvgWriter& writer) {
  for (const Tick& tick : y.range.ticks) {
    const double at = y.at(tick.value);
    writer.line({box.left, at}, {box.right(), at}, {.colour = writer.colour(Ink::grid)});
    writer.text({box.left - 6.0, at + 4.5}, tick.label, {.anchor = Anchor::end});
  }
  writer.line({box.left, box.top}, {box.left, box.bottom()}, {.colour = writer.colour(Ink::text)});
}

std::string place_text(char command, double x, double y) {
  return command + coordinate(x) + " " + coordinate(y);
}

void draw(const Bars& bars, const PlotArea& area, SvgWriter& writer) {
  constexpr double least_width = 2.0;  // Bars of equal values have none.
  for (std::size_t i = 0; i < num_bars(bars); ++i) {
    if (!(bars.heights[i] > 0.0) || !area.y.has(bars.heights[i])) continue;
    const double begin = area.x.at(bars.edges[i]);
    const double end = area.x.at(bars.edges[i + 1]);
    const double lacking = std::max(0.0, least_width - (end - begin));
    const double left = std::max(begin - lacking / 2.0, area.box.left);
    const double right = std::min(end + lacking / 2.0, area.box.right());
    const double top = std::max(area.y.at(bars.heights[i]), area.box.top);
    if (!(right > left)) continue;
    // A gap between neighbours, which else would look like one bar.
    const double gap = right - left > 3.0 ? 1.0 : 0.0;
    writer.rectangle({left, top, right - left - gap, area.box.bottom() - top},
                     writer.colour(bars.ink));
  }
}

/// Of its marks, if it is no line.
std::optional<Shape> shape_of(const Curve& curve) {
  if (const auto* const shape = std::get_if<Shape>(&curve.look)) return *shape;
  return curve.points.size() == 1 ? std::optional(Shape::diamond) : std::nullopt;
}

void draw(const Curve& curve, const PlotArea& area, SvgWriter& writer) {
  const std::optional<Shape> shape = shape_of(curve);
  std::string path;
  bool is_begun = false;
  for (const Point& point : curve.points) {
    const bool has_place = area.x.has(point.x) && area.y.has(point.y);
    if (shape) {
      if (!area.x.contains(point.x) || !area.y.contains(point.y)) continue;
      writer.marker({area.x.at(point.x), area.y.at(point.y)}, *shape, curve.ink);
    } else if (has_place) {
      path += place_text(is_begun ? 'L' : 'M', area.x.at(point.x), area.y.at(point.y));
    }
    is_begun = has_place;
  }
  if (path.empty()) return;
  writer.outline(
      path, {.colour = writer.colour(curve.ink), .width = 2.0, .dash = std::get<Dash>(curve.look)});
}

void draw(const Band& band, const PlotArea& area, SvgWriter& writer) {
  std::string upper;
  std::string lower;
  for (const BandPoint& point : band.points) {
    const bool is_finite = std::isfinite(point.lower) && std::isfinite(point.upper);
    if (!area.x.has(point.x) || !is_finite) continue;
    const double x = area.x.at(point.x);
    upper += place_text(upper.empty() ? 'M' : 'L', x, area.y.at(point.upper));
    lower = place_text('L', x, area.y.at(point.lower)) + lower;
  }
  if (upper.empty()) return;
  writer.area(upper + lower + "Z", writer.colour(band.ink), 0.25);
}

/// draw_chart() writes the label above the box.
void draw(const LimitLine& limit, const PlotArea& area, SvgWriter& writer) {
  if (!area.x.contains(limit.value)) return;
  const double x = area.x.at(limit.value);
  writer.line({x, area.box.top}, {x, area.box.bottom()},
              {.colour = writer.colour(limit.ink), .width = 2.0, .dash = limit.dash});
}

bool is_marked(const Layer& layer) {
  const auto* const curve = std::get_if<Curve>(&layer);
  return curve != nullptr && shape_of(*curve);
}

void draw_layers(const Chart& chart, const PlotArea& area, SvgWriter& writer) {
  const auto draw_it = [&](const auto& layer) { draw(layer, area, writer); };
  writer.raw(fmt::format(
      "<clipPath id=\"{}-clip\"><rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"/></clipPath>\n"
      "<g clip-path=\"url(#{}-clip)\">\n",
      chart.text.id, coordinate(area.box.left), coordinate(area.box.top),
      coordinate(area.box.width), coordinate(area.box.height), chart.text.id));
  for (const Layer& layer : chart.layers) {
    if (!is_marked(layer)) std::visit(draw_it, layer);
  }
  writer.raw("</g>\n");
  // Half of a marker, and its label, may be outside of the axes.
  for (const Layer& layer : chart.layers) {
    if (is_marked(layer)) std::visit(draw_it, layer);
  }
}

double draw_head(const Chart& chart, const PlotArea& area, Point corner, double width,
                 SvgWriter& writer) {
  double height = draw_title(chart.text.title, corner, width, writer);
  height += draw_legend(legend_of(chart, area), {corner.x, corner.y + height}, width, writer);
  if (chart.y.label.empty()) return height + 8.0;
  writer.text({corner.x, corner.y + height + 13.0}, chart.y.label);
  return height + 24.0;
}

}  // namespace

double draw_chart(const Chart& chart, Point corner, double width, SvgWriter& writer) {
  constexpr double right_margin = 16.0;
  const Extents extents = extents_of(chart);
  PlotArea area;
  area.y = {.scale = chart.y.scale,
            .range = range_of(chart.y, extents.y, num_ticks_for(chart.plot_height, 35.0))};
  double left = label_margin(area.y.range), right = right_margin;
  area.x = {.scale = chart.x.scale,
            .range = range_of(chart.x, extents.x, num_ticks_for(width - left - right, 50.0))};
  if (const std::vector<Tick>& ticks = area.x.range.ticks; !ticks.empty()) {
    left = std::max(left, half_width(ticks.front().label));
    right = std::max(right, half_width(ticks.back().label));
  }
  area.box = {corner.x + left, 0.0, width - left - right, chart.plot_height};
  area.x.begin = area.box.left;
  area.x.end = area.box.right();
  const std::vector<const LimitLine*> limits = vertical_limits(chart, area.x);
  area.box.top = corner.y + draw_head(chart, area, corner, width, writer) +
                 limit_row_height * static_cast<double>(limits.size());
  area.y.begin = area.box.bottom();
  area.y.end = area.box.top;
  draw_y_axis(area.y, area.box, writer);
  draw_x_axis(area.x, chart.x, area.box, writer);
  draw_layers(chart, area, writer);
  draw_limit_labels(limits, area.x, area.box, writer);
  const auto is_layer_seen = [&](const Layer& layer) { return is_seen(layer, area); };
  if (std::ranges::none_of(chart.layers, is_layer_seen)) {
    writer.text({area.box.left + area.box.width / 2.0, area.box.top + area.box.height / 2.0},
                "nothing to show", {.anchor = Anchor::middle});
  }
  return area.box.bottom() + x_axis_height - corner.y;
}

double draw_chart(const ChartGrid& grid, Point corner, double width, SvgWriter& writer) {
  constexpr double gap = 14.0;
  const double cell_width = (width - gap) / 2.0;
  double top = corner.y + draw_title(grid.text.title, corner, width, writer) + 4.0;
  double row_height = 0.0;
  for (std::size_t i = 0; i < grid.charts.size(); ++i) {
    if (i > 0 && i % 2 == 0) top += std::exchange(row_height, 0.0) + 8.0;
    const Point place{corner.x + (i % 2 == 0 ? 0.0 : cell_width + gap), top};
    row_height = std::max(row_height, draw_chart(grid.charts[i], place, cell_width, writer));
  }
  return top + row_height - corner.y;
}

namespace {

constexpr double line_height = 19.0;

/// Lines of whole words, as far as words fit; at most three.
std::vector<std::string> title_lines(std::string_view text, double width) {
  constexpr std::size_t num_lines_max = 3;
  constexpr double bold = 1.12;  // Against the mean letter.
  const auto num_columns =
      static_cast<std::size_t>(std::max(width / (bold * text_width("m")), 8.0));
  std::vector<std::string> lines = lines_of(std::string(text), num_columns, num_columns);
  for (std::size_t i = num_lines_max; i < lines.size(); ++i) {
    lines[num_lines_max - 1] += " " + lines[i];
  }
  lines.resize(std::min(lines.size(), num_lines_max));
  for (std::string& line : lines) line = wire::shortened(line, num_columns);
  return lines;
}

constexpr double sample_width = 22.0;

void draw_sample(const LegendEntry& entry, Point place, SvgWriter& writer) {
  const double middle = place.y - 4.5;
  const std::string colour = writer.colour(entry.ink);
  if (const auto* const shape = std::get_if<Shape>(&entry.look)) {
    writer.marker({place.x + 8.0, middle}, *shape, entry.ink);
  } else if (const auto* const dash = std::get_if<Dash>(&entry.look)) {
    writer.line({place.x, middle}, {place.x + sample_width - 4.0, middle},
                {.colour = colour, .width = 2.0, .dash = *dash});
  } else {
    writer.rectangle({place.x, place.y - 10.0, sample_width - 6.0, 10.0}, colour,
                     std::get<double>(entry.look), Stroke{.colour = colour});
  }
}

}  // namespace

double AxisMap::part_of(double value) const {
  if (scale == Scale::linear) return (value - range.from) / (range.to - range.from);
  if (!(value > 0.0)) return 0.0;
  return std::log(value / range.from) / std::log(range.to / range.from);
}

bool AxisMap::contains(double value) const {
  if (!has(value)) return false;
  const double place = part_of(value);
  return place >= -1e-9 && place <= 1.0 + 1e-9;
}

bool AxisMap::has(double value) const {
  return std::isfinite(value) && (scale == Scale::linear || value > 0.0);
}

double draw_title(std::string_view title, Point corner, double width, SvgWriter& writer) {
  double height = 0.0;
  for (const std::string& line : title_lines(title, width)) {
    height += line_height;
    writer.text({corner.x, corner.y + height - 4.0}, line, {.is_bold = true});
  }
  return height + 3.0;
}

double draw_legend(std::span<const LegendEntry> entries, Point corner, double width,
                   SvgWriter& writer) {
  if (entries.empty()) return 0.0;
  Point place{corner.x, corner.y + 14.0};
  for (const LegendEntry& entry : entries) {
    const double needed = sample_width + 1.06 * text_width(entry.name) + 14.0;
    if (place.x > corner.x && place.x + needed > corner.x + width) {
      place = {corner.x, place.y + line_height};
    }
    draw_sample(entry, place, writer);
    writer.text({place.x + sample_width, place.y}, entry.name);
    place.x += needed;
  }
  return place.y - corner.y + 8.0;
}

void Extent::add(double value) {
  if (!std::isfinite(value) || (scale == Scale::logarithmic && value <= 0.0)) return;
  from = std::min(from.value_or(value), value);
  to = std::max(to.value_or(value), value);
}

AxisRange range_of(const ChartAxis& axis, const Extent& data, std::size_t num_ticks_max) {
  const bool is_linear = axis.scale == Scale::linear;
  const double lower = data.from.value_or(is_linear ? 0.0 : 1.0);
  const double upper = data.to.value_or(is_linear ? 1.0 : 10.0);
  return is_linear ? linear_range(axis, lower, upper, num_ticks_max)
                   : logarithmic_range(axis, lower, upper, num_ticks_max);
}

namespace {

/// Every how many of the ticks have a label, so that none touches another.
std::size_t label_stride(const AxisMap& x) {
  const std::vector<Tick>& ticks = x.range.ticks;
  const auto touch = [&](const Tick& left, const Tick& right) {
    return x.at(right.value) - x.at(left.value) <
           half_width(left.label) + half_width(right.label) + 3.0;
  };
  std::size_t stride = 1;
  for (std::size_t i = 0; i + stride < ticks.size();) {
    if (touch(ticks[i], ticks[i + stride])) {
      ++stride;
      i = 0;
    } else {
      i += stride;
    }
  }
  return stride;
}

}  // namespace

void draw_x_axis(const AxisMap& x, const ChartAxis& axis, const Box& box, SvgWriter& writer) {
  const std::vector<Tick>& ticks = x.range.ticks;
  const std::size_t stride = label_stride(x);
  for (std::size_t i = 0; i < ticks.size(); ++i) {
    const double at = x.at(ticks[i].value);
    writer.line({at, box.top}, {at, box.bottom()}, {.colour = writer.colour(Ink::grid)});
    if (i % stride != 0) continue;
    writer.text({at, box.bottom() + 16.0}, ticks[i].label, {.anchor = Anchor::middle});
  }
  writer.line({box.left, box.bottom()}, {box.right(), box.bottom()},
              {.colour = writer.colour(Ink::text)});
  writer.text({box.left + box.width / 2.0, box.bottom() + 34.0}, axis.label,
              {.anchor = Anchor::middle});
}

}  // namespace proofmass::coordinator
