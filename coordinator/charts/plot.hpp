#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>

#include "coordinator/charts/chart.hpp"

namespace proofmass::coordinator {

/// A coordinate with at most two decimals, and as few as it takes.
[[nodiscard]] std::string coordinate(double value);

enum class Anchor : std::uint8_t { start, middle, end };

struct TextStyle {
  Anchor anchor = Anchor::start;
  bool is_bold = false;
  double rotation = 0.0;  ///< Degrees, clockwise, about the place of the text.
};

inline constexpr double text_size = 13.0;

/// Width of a text by the mean width of letters, about 5 % too large for most.
[[nodiscard]] double text_width(std::string_view text);

struct Box {
  double left = 0.0;
  double top = 0.0;
  double width = 0.0;
  double height = 0.0;

  [[nodiscard]] double right() const { return left + width; }
  [[nodiscard]] double bottom() const { return top + height; }
};

struct Stroke {
  std::string colour;
  double width = 1.0;
  Dash dash = Dash::solid;
};

/// Elements of SVG, one after the other. Coordinates are those of the picture, y downwards.
class SvgWriter {
 public:
  /// As a value of `fill` or `stroke`.
  [[nodiscard]] std::string colour(Ink ink) const;

  /// @param place  Of the start, middle or end of the text's baseline.
  void text(Point place, std::string_view text, const TextStyle& style = {});
  void rectangle(const Box& box, std::string_view fill, double opacity = 1.0,
                 const std::optional<Stroke>& stroke = {});
  void line(Point from, Point to, const Stroke& stroke);
  /// @param path  Data of a path, `M0 0L1 1`.
  void outline(std::string_view path, const Stroke& stroke);
  void area(std::string_view path, std::string_view fill, double opacity);
  void marker(Point centre, Shape shape, Ink ink);

  /// What is drawn until end_group() shows this text under the pointer.
  void begin_group(std::string_view tooltip);
  void end_group() { markup_ += "</g>\n"; }

  void raw(std::string_view markup) { markup_ += markup; }
  [[nodiscard]] const std::string& markup() const { return markup_; }

 private:
  std::string markup_;
};

/// Where values of an axis are in the picture.
struct AxisMap {
  Scale scale = Scale::linear;
  AxisRange range;
  double begin = 0.0;  ///< Coordinate of the axis' lower end.
  double end = 0.0;    ///< Coordinate of the upper end.

  /// Coordinate of a value, also of one beyond the axis' ends. On a logarithmic axis a value that
  /// is not above 0 is at the lower end.
  [[nodiscard]] double at(double value) const { return begin + part_of(value) * (end - begin); }
  /// True if the value is between the ends.
  [[nodiscard]] bool contains(double value) const;
  /// True if the value has a place at all.
  [[nodiscard]] bool has(double value) const;

 private:
  /// 0 at the lower end, 1 at the upper one.
  [[nodiscard]] double part_of(double value) const;
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

}  // namespace proofmass::coordinator
