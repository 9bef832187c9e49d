#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>

#include "coordinator/charts/chart.hpp"
#include "coordinator/charts/svg_writer.hpp"
#include "coordinator/charts/ticks.hpp"

namespace proofmass::coordinator {

/// Where values of an axis are in the picture.
struct AxisMap {
  Scale scale = Scale::linear;
  AxisRange range;
  double begin = 0.0;  ///< Coordinate of the axis' lower end.
  double end = 0.0;    ///< Coordinate of the upper end.

  /// Coordinate of a value, also of one beyond the axis' ends. On a logarithmic axis a value that
  /// is not above 0 is at the lower end.
  [[nodiscard]] double at(double value) const;
  /// True if the value is between the ends.
  [[nodiscard]] bool contains(double value) const;
  /// True if the value has a place at all.
  [[nodiscard]] bool has(double value) const;
};

/// Draws title, legend, axes and layers into a box of this width, from its upper left corner at
/// (left, top) on.
/// @return The height that it took.
double draw_chart(const Chart& chart, Point corner, double width, SvgWriter& writer);
double draw_chart(const BarChart& chart, Point corner, double width, SvgWriter& writer);
double draw_chart(const HeatMap& map, Point corner, double width, SvgWriter& writer);
double draw_chart(const ChartGrid& grid, Point corner, double width, SvgWriter& writer);
double draw_chart(const Timeline& timeline, Point corner, double width, SvgWriter& writer);

/// The width that the cells and labels of a map take.
[[nodiscard]] double width_of(const HeatMap& map);

/// Draws a title in one to three lines.
/// @return The height that it took.
double draw_title(std::string_view title, Point corner, double width, SvgWriter& writer);

/// A line of the legend: how a layer looks, and its name.
struct LegendEntry {
  std::string name = {};
  Ink ink = Ink::first;
  std::variant<double, Dash, Shape> look = 1.0;  ///< An area of an opacity, a line or a mark.
};

/// @return The height that it took; 0 without entries.
double draw_legend(std::span<const LegendEntry> entries, Point corner, double width,
                   SvgWriter& writer);

/// Grid lines and labels of ticks below the box, and the axis' label.
void draw_x_axis(const AxisMap& x, const ChartAxis& axis, const Box& box, SvgWriter& writer);
/// Grid lines and labels of ticks on the left of the box; the label is not drawn.
void draw_y_axis(const AxisMap& y, const Box& box, SvgWriter& writer);

inline constexpr double x_axis_height = 42.0;  ///< Of the ticks and label below a plot.

/// The ends of those values that have a place on an axis.
struct Extent {
  Scale scale = Scale::linear;
  std::optional<double> from = {};
  std::optional<double> to = {};

  void add(double value);
};

/// The axis between the ends of the data; a range of its own if there is none.
[[nodiscard]] AxisRange range_of(const ChartAxis& axis, const Extent& data,
                                 std::size_t num_ticks_max);

/// Draws a layer into the box between the axes.
struct PlotArea {
  AxisMap x;
  AxisMap y;
  Box box;
};
void draw_layer(const Layer& layer, const PlotArea& area, SvgWriter& writer);

}  // namespace proofmass::coordinator
