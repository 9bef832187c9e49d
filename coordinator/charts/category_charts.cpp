
#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "coordinator/charts/plot.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

constexpr double bar_height = 15.0;
constexpr double group_gap = 9.0;

/// How a series differs from the others beside its colour: filled, pale, empty.
constexpr std::array series_opacities{1.0, 0.3, 0.0};

double opacity_of_series(std::size_t index) {
  return series_opacities.at(index % series_opacities.size());
}

std::vector<LegendEntry> legend_of_series(const BarChart& chart) {
  std::vector<LegendEntry> entries;
  for (std::size_t i = 0; i < chart.series.size(); ++i) {
    entries.push_back(
        {.name = chart.series[i].name, .ink = chart.series[i].ink, .look = opacity_of_series(i)});
  }
  return entries;
}

AxisRange range_of_values(const BarChart& chart) {
  Extent extent{.scale = chart.x.scale};
  for (const BarSeries& series : chart.series) {
    for (const std::optional<double>& value : series.values) {
      if (value) extent.add(*value);
    }
  }
  if (extent.from && chart.x.scale == Scale::linear) extent.from = std::min(*extent.from, 0.0);
  return range_of(chart.x, extent, 5);
}

double widest(std::span<const std::string> labels) {
  double width = 0.0;
  for (const std::string& label : labels) width = std::max(width, text_width(label));
  return width;
}

std::vector<std::string> shortened_labels(std::span<const std::string> labels,
                                          std::size_t num_columns_max) {
  std::vector<std::string> shorter;
  for (const std::string& label : labels) {
    shorter.push_back(wire::shortened(label, num_columns_max));
  }
  return shorter;
}

/// The bars of one category, from `top` on.
void draw_group(const BarChart& chart, std::size_t category, double top, const AxisMap& x,
                SvgWriter& writer) {
  for (std::size_t i = 0; i < chart.series.size(); ++i) {
    const BarSeries& series = chart.series[i];
    const std::optional<double> value =
        category < series.values.size() ? series.values[category] : std::nullopt;
    const double bar_top = top + bar_height * static_cast<double>(i);
    if (!value || !std::isfinite(*value)) continue;
    const double end = std::clamp(x.at(*value), x.begin, x.end);
    const std::string colour = writer.colour(series.ink);
    writer.rectangle({x.begin, bar_top + 1.0, end - x.begin, bar_height - 2.0}, colour,
                     opacity_of_series(i), Stroke{.colour = colour});
    writer.text({end + 5.0, bar_top + bar_height - 2.0}, figure_text(*value));
  }
}

constexpr double cell_width = 38.0;
constexpr double cell_height = 23.0;

/// So strong that the cell is seen, and so pale that the text in it is readable.
constexpr double cell_opacity_max = 0.5;

void draw_cells(const HeatMap& map, Point corner, SvgWriter& writer) {
  for (std::size_t i = 0; i < map.cells.size() && !map.columns.empty(); ++i) {
    const HeatCell& cell = map.cells[i];
    const Box box{corner.x + cell_width * static_cast<double>(i % map.columns.size()),
                  corner.y + cell_height * static_cast<double>(i / map.columns.size()), cell_width,
                  cell_height};
    const double value = cell.value.value_or(0.0);
    const double strength = std::isfinite(value) ? std::min(std::abs(value), 1.0) : 0.0;
    writer.rectangle(box, writer.colour(value < 0.0 ? Ink::second : Ink::first),
                     cell_opacity_max * strength, Stroke{.colour = writer.colour(Ink::grid)});
    if (cell.label.empty()) continue;
    writer.text({box.left + cell_width / 2.0, box.bottom() - 7.0}, cell.label,
                {.anchor = Anchor::middle});
  }
}

constexpr double turned_degrees = -50.0;
constexpr double turned_height = 0.77;  ///< sin 50°.
constexpr double turned_width = 0.65;   ///< cos 50°.

std::vector<std::string> row_labels(const HeatMap& map) { return shortened_labels(map.rows, 44); }

std::vector<std::string> column_labels(const HeatMap& map) {
  return shortened_labels(map.columns, 16);
}

}  // namespace

double draw_chart(const BarChart& chart, Point corner, double width, SvgWriter& writer) {
  constexpr double value_margin = 84.0;
  const std::vector<std::string> labels = shortened_labels(chart.categories, 26);
  const double left = widest(labels) + 10.0;
  double height = draw_title(chart.text.title, corner, width, writer);
  height += draw_legend(legend_of_series(chart), {corner.x, corner.y + height}, width, writer);
  const double group_height = bar_height * static_cast<double>(chart.series.size()) + group_gap;
  const Box box{corner.x + left, corner.y + height + 4.0, width - left - value_margin,
                group_height * static_cast<double>(labels.size())};
  const AxisMap x{.scale = chart.x.scale,
                  .range = range_of_values(chart),
                  .begin = box.left,
                  .end = box.right()};
  draw_x_axis(x, chart.x, box, writer);
  for (std::size_t i = 0; i < labels.size(); ++i) {
    const double top = box.top + group_height * static_cast<double>(i) + group_gap / 2.0;
    writer.text({box.left - 6.0, top + (group_height - group_gap) / 2.0 + 4.5}, labels[i],
                {.anchor = Anchor::end});
    draw_group(chart, i, top, x, writer);
  }
  writer.line({box.left, box.top}, {box.left, box.bottom()}, {.colour = writer.colour(Ink::text)});
  return box.bottom() + x_axis_height - corner.y;
}

double width_of(const HeatMap& map) {
  return widest(row_labels(map)) + 8.0 + cell_width * static_cast<double>(map.columns.size()) +
         turned_width * widest(column_labels(map));
}

double draw_chart(const HeatMap& map, Point corner, double width, SvgWriter& writer) {
  const std::vector<std::string> rows = row_labels(map);
  const std::vector<std::string> columns = column_labels(map);
  const double head = turned_height * widest(columns) + 14.0;
  const Point place{corner.x + widest(rows) + 8.0,
                    corner.y + draw_title(map.text.title, corner, width, writer) + head};
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const double x = place.x + cell_width * (static_cast<double>(i) + 0.5);
    writer.text({x, place.y - 7.0}, columns[i], {.rotation = turned_degrees});
  }
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const double y = place.y + cell_height * (static_cast<double>(i) + 1.0) - 7.0;
    writer.text({place.x - 6.0, y}, rows[i], {.anchor = Anchor::end});
  }
  draw_cells(map, place, writer);
  return place.y + cell_height * static_cast<double>(rows.size()) + 4.0 - corner.y;
}

namespace {

constexpr double label_width = 170.0;
constexpr double lane_height = 16.0;
constexpr std::size_t label_columns_max = 24;

void draw_bars(std::span<const TimelineBar> bars, Ink ink, const AxisMap& x, double top,
               SvgWriter& writer) {
  constexpr double width_min = 2.0;
  for (const TimelineBar& bar : bars) {
    if (!(bar.end >= x.range.from) || !(bar.begin <= x.range.to)) continue;
    const double begin = std::clamp(x.at(bar.begin), x.begin, x.end);
    const double end = std::clamp(x.at(bar.end), x.begin, x.end);
    writer.begin_group(bar.tooltip);
    writer.rectangle({begin, top + 3.0, std::max(width_min, end - begin), lane_height - 6.0},
                     writer.colour(ink));
    writer.end_group();
  }
}

}  // namespace

double draw_chart(const Timeline& timeline, Point corner, double width, SvgWriter& writer) {
  constexpr std::size_t num_ticks_max = 8;
  const double height = draw_title(timeline.text.title, corner, width, writer);
  const Box box{corner.x + label_width, corner.y + height + 4.0, width - label_width - 12.0,
                lane_height * static_cast<double>(timeline.lanes.size())};
  const AxisMap x{.scale = timeline.x.scale,
                  .range = range_of(timeline.x, {}, num_ticks_max),
                  .begin = box.left,
                  .end = box.right()};
  draw_x_axis(x, timeline.x, box, writer);
  for (std::size_t i = 0; i < timeline.lanes.size(); ++i) {
    const TimelineLane& lane = timeline.lanes[i];
    const double top = box.top + lane_height * static_cast<double>(i);
    writer.text({corner.x, top + lane_height - 4.0},
                wire::shortened(lane.label, label_columns_max));
    draw_bars(lane.bars, Ink::first, x, top, writer);
    draw_bars(lane.marks, Ink::second, x, top, writer);
  }
  return box.bottom() + x_axis_height - corner.y;
}

}  // namespace proofmass::coordinator
