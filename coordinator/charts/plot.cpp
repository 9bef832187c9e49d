#include "coordinator/charts/plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>
#include <vector>

namespace proofmass::coordinator {
namespace {

struct Extents {
  Extent x;
  Extent y;
  bool has_data = false;  ///< Something beside limits.

  void add(const Bars& bars) {
    for (const double edge : bars.edges) x.add(edge);
    for (const double height : bars.heights) y.add(height);
    y.add(0.0);
    has_data |= !bars.heights.empty();
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
    has_data = true;
  }
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

std::vector<LegendEntry> legend_of(const Chart& chart) {
  std::vector<LegendEntry> entries;
  for (const Layer& layer : chart.layers) {
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

double label_margin(const AxisRange& range) {
  double width = 20.0;
  for (const Tick& tick : range.ticks) width = std::max(width, text_width(tick.label));
  return width + 10.0;
}

bool is_marked(const Layer& layer) {
  const auto* const curve = std::get_if<Curve>(&layer);
  return curve != nullptr && std::holds_alternative<Shape>(curve->look);
}

void draw_layers(const Chart& chart, const PlotArea& area, SvgWriter& writer) {
  writer.raw(fmt::format(
      "<clipPath id=\"{}-clip\"><rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"/></clipPath>\n"
      "<g clip-path=\"url(#{}-clip)\">\n",
      chart.text.id, coordinate(area.box.left), coordinate(area.box.top),
      coordinate(area.box.width), coordinate(area.box.height), chart.text.id));
  for (const Layer& layer : chart.layers) {
    if (!is_marked(layer)) draw_layer(layer, area, writer);
  }
  writer.raw("</g>\n");
  // Half of a marker, and its label, may be outside of the axes.
  for (const Layer& layer : chart.layers) {
    if (is_marked(layer)) draw_layer(layer, area, writer);
  }
}

double draw_head(const Chart& chart, Point corner, double width, SvgWriter& writer) {
  double height = draw_title(chart.text.title, corner, width, writer);
  height += draw_legend(legend_of(chart), {corner.x, corner.y + height}, width, writer);
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
  const double left = label_margin(area.y.range);
  area.box = {corner.x + left, 0.0, width - left - right_margin, chart.plot_height};
  area.x = {.scale = chart.x.scale,
            .range = range_of(chart.x, extents.x, num_ticks_for(area.box.width, 50.0)),
            .begin = area.box.left,
            .end = area.box.right()};
  const std::vector<const LimitLine*> limits = vertical_limits(chart, area.x);
  area.box.top = corner.y + draw_head(chart, corner, width, writer) +
                 limit_row_height * static_cast<double>(limits.size());
  area.y.begin = area.box.bottom();
  area.y.end = area.box.top;
  draw_y_axis(area.y, area.box, writer);
  draw_x_axis(area.x, chart.x, area.box, writer);
  draw_layers(chart, area, writer);
  draw_limit_labels(limits, area.x, area.box, writer);
  if (!extents.has_data) {
    writer.text({area.box.left + area.box.width / 2.0, area.box.top + area.box.height / 2.0},
                "no data", {.anchor = Anchor::middle});
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

}  // namespace proofmass::coordinator
