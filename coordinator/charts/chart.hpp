#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace proofmass::coordinator {

// What a chart shows, without a pixel. All data are binned or thinned by the caller, so that the
// size of a picture does not depend on the number of runs. Texts may hold anything: they are
// escaped where they are drawn.

/// Colours by their role. A page or a theme says what they look like, see theme_colours(). Nothing
/// is told by colour alone: layers also differ by dash, shape or label.
enum class Ink : std::uint8_t { ground, text, grid, first, second, third, fourth };
enum class Dash : std::uint8_t { solid, dashed, dotted };
enum class Shape : std::uint8_t { triangle, diamond };

enum class Scale : std::uint8_t { linear, logarithmic };

struct ChartAxis {
  std::string label = {};  ///< With its unit: `|error|, nm`.
  Scale scale = Scale::linear;
  /// Ends of the axis; an end that is not given is that of the data, rounded outwards. Ends that
  /// are not finite, or not above 0 on a logarithmic axis, are ignored.
  std::optional<double> from = {};
  std::optional<double> to = {};
  bool is_count = false;  ///< Ticks are whole numbers. Of a linear axis.
};

struct Point {
  double x = 0.0;
  double y = 0.0;
};

struct Bars {
  std::string name = {};             ///< In the legend; if empty, it is not listed there.
  std::vector<double> edges = {};    ///< Ascending; one more than there are heights.
  std::vector<double> heights = {};  ///< ≥ 0.
  Ink ink = Ink::first;
};

/// Points joined by straight lines, or marked. A point that is not finite, or not above 0 on a
/// logarithmic axis, ends the line; the next one begins it anew.
struct Curve {
  std::string name = {};  ///< In the legend; if empty, it is not listed there.
  std::vector<Point> points = {};
  Ink ink = Ink::first;
  std::variant<Dash, Shape> look = Dash::solid;  ///< Of the line, or of each mark.
};

struct BandPoint {
  double x = 0.0;
  double lower = 0.0;
  double upper = 0.0;
};

/// An area between two curves: an interval along a line.
struct Band {
  std::string name = {};
  std::vector<BandPoint> points = {};
  Ink ink = Ink::first;
};

/// A vertical line across the whole chart, with its label above it.
struct LimitLine {
  std::string label = {};
  double value = 0.0;
  Ink ink = Ink::second;
  Dash dash = Dash::dashed;
};

using Layer = std::variant<Bars, Curve, Band, LimitLine>;

struct ChartText {
  /// Unique in a page: elements of the picture are named after it. 1 to 200 of A-Z a-z 0-9 _ and -,
  /// a letter first.
  std::string id;
  std::string title;  ///< Above the picture, and its name for screen readers.
  /// What the picture tells, for those who do not see it; sentences.
  std::string description = {};
};

/// Layers over two axes, drawn in their order.
struct Chart {
  ChartText text;
  ChartAxis x = {};
  ChartAxis y = {};
  std::vector<Layer> layers = {};
  double plot_height = 190.0;  ///< Of the area between the axes, of a picture 480 wide.
};

/// Values of one kind, one a category. A value that is missing has no bar.
struct BarSeries {
  std::string name = {};
  std::vector<std::optional<double>> values = {};
  Ink ink = Ink::first;
};

/// Horizontal bars, a group a category, with their values as text at their ends.
struct BarChart {
  ChartText text;
  ChartAxis x;  ///< Of the values. Bars begin at the left end of the axis.
  std::vector<std::string> categories;
  std::vector<BarSeries> series;  ///< Values in the order of the categories.
};

/// A cell without a value is empty.
struct HeatCell {
  std::optional<double> value = {};  ///< −1 to 1: the strength of the colour, and its sign.
  std::string label = {};  ///< In the cell, at most four characters; tells sign and value.
};

/// Cells with a colour each, as for correlations.
struct HeatMap {
  ChartText text;
  std::vector<std::string> rows;
  std::vector<std::string> columns = {};
  std::vector<HeatCell> cells = {};  ///< Row by row: rows times columns.
};

/// Several charts as one picture, two beside each other.
struct ChartGrid {
  ChartText text;
  std::vector<Chart> charts = {};  ///< Row by row.
};

/// Something that took a time, or none: a bar of a timeline, two pixels wide at least.
struct TimelineBar {
  double begin = 0.0;
  double end = 0.0;
  std::string tooltip = {};  ///< Shown under the pointer.
};

struct TimelineLane {
  std::string label = {};  ///< Empty: the lane belongs to the one above.
  std::vector<TimelineBar> bars = {};
  std::vector<TimelineBar> marks = {};  ///< In another ink.
};

/// Lanes over one axis of time, which is linear and gives both of its ends. What is outside of them
/// is cut off.
struct Timeline {
  ChartText text;
  ChartAxis x;
  std::vector<TimelineLane> lanes = {};
};

using Picture = std::variant<Chart, BarChart, HeatMap, ChartGrid, Timeline>;

[[nodiscard]] const ChartText& text_of(const Picture& picture);

/// Where a picture is shown.
enum class SvgUse : std::uint8_t {
  /// In an HTML page, which sets the colours with light_colours() and dark_colours(). Without them,
  /// they are the light ones.
  embedded,
  /// As a file: with its namespace, its ground, and the light colours at each element, as programs
  /// for documents and bitmaps know no custom properties.
  file,
};

/// The picture as SVG, the same bytes for the same picture. All texts of all pictures have one
/// size. In a page, a picture 480 wide takes 440 pixels; texts are still readable at 360. For
/// screen readers it is one image with title and description.
///
/// Data that are not finite, or not above 0 on a logarithmic axis, are left out. If nothing is left
/// between the axes, `nothing to show` stands there.
[[nodiscard]] std::string svg_of(const Picture& picture, SvgUse use);

/// A colour of charts, as custom property of CSS and as what it is on a light and a dark ground.
struct ThemeColour {
  std::string_view property;  ///< `--chart-first`.
  std::string_view light;     ///< `#0072b2`.
  std::string_view dark;
};

/// Ground, text, grid, and the four inks [Okabe and Ito 2008]. Text has a contrast of 7:1 against
/// its ground at least, the inks 3:1; the grid is only for the eye and may be fainter.
[[nodiscard]] std::span<const ThemeColour> theme_colours();

/// Declarations `--chart-ground:#ffffff;...` for the rule of a page that embeds charts.
[[nodiscard]] std::string light_colours();
[[nodiscard]] std::string dark_colours();

/// A number as people write it: at most three significant digits, or all of a whole number, U+2212
/// as its minus sign, and powers of ten in superscripts outside of 0.001 to 99,999: `−0.25`,
/// `1244`, `2.5×10⁻⁹`, `10⁶`.
/// @param num_digits  At most, if not three; up to 15.
[[nodiscard]] std::string figure_text(double value, int num_digits = 3);

/// A measured figure in the spelling of figure_text(), with zeros at its end up to three digits:
/// `12.0`, `9.20`, `1.00×10⁵`.
[[nodiscard]] std::string measured_text(double value);

/// A unit in the same spelling: `10⁻⁴ rad` for `1e-4 rad`.
[[nodiscard]] std::string unit_text(std::string_view unit);

/// A place on an axis that has a line and a label.
struct Tick {
  double value = 0.0;
  std::string label;  ///< With as many digits as it takes to tell it from its neighbours.
};

/// Where an axis begins and ends, and its ticks, which are not outside.
struct AxisRange {
  double from = 0.0;
  double to = 1.0;
  std::vector<Tick> ticks = {};
};

/// Steps are 1, 2 or 5 times a power of ten, the smallest with `num_ticks_max` ticks at most.
/// @param axis      Of a linear scale. An end that it does not give is moved outwards to a tick.
/// @param from, to  Of the data. If they are equal, the range is made wider.
/// @param num_ticks_max  2 or more.
[[nodiscard]] AxisRange linear_range(const ChartAxis& axis, double from, double to,
                                     std::size_t num_ticks_max);

/// Ticks are 1, 2 and 5 times powers of ten over less than two of these, and if they are few
/// enough; else powers of ten, every k-th from the first on, with the smallest k for which they
/// are.
/// @param axis      Of a logarithmic scale. An end that it does not give is moved outwards to 1, 2
///                  or 5 times a power of ten.
/// @param from, to  Of the data, above 0.
[[nodiscard]] AxisRange logarithmic_range(const ChartAxis& axis, double from, double to,
                                          std::size_t num_ticks_max);

}  // namespace proofmass::coordinator
