#include "coordinator/charts/chart.hpp"
#include "tests/coordinator/charts/markup_reading.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

const std::string hostile = "<script>alert(\"1\")</script> & 'x' \x1b[31m \xff \u202e";

Chart histogram() {
  return {.text = {.id = "histogram", .title = "Errors", .description = "Most are small."},
          .x = {.label = "|error|, nm", .from = 0.0, .to = 40.0},
          .y = {.label = "runs", .from = 0.0, .to = 10.0},
          .layers = {Bars{.name = "runs",
                          .edges = {0.0, 10.0, 20.0, 30.0, 40.0},
                          .heights = {10.0, 5.0, 0.0, 1.0}},
                     LimitLine{.label = "objective 30", .value = 30.0}}};
}

std::vector<Picture> pictures_with(const std::string& text) {
  Chart chart = histogram();
  chart.text.title = chart.text.description = chart.x.label = chart.y.label = text;
  chart.layers = {Bars{.name = text, .edges = {0.0, 1.0}, .heights = {1.0}},
                  Curve{.name = text, .points = {{0.0, 1.0}, {1.0, 2.0}}},
                  Curve{.name = text, .points = {{1.0, 1.0}}, .look = Shape::triangle},
                  Band{.name = text, .points = {{0.0, 1.0, 2.0}, {1.0, 1.0, 2.0}}},
                  LimitLine{.label = text, .value = 20.0}};
  const ChartText of_chart{.id = "x", .title = text, .description = text};
  const BarChart bars{.text = of_chart,
                      .x = {.label = text},
                      .categories = {text},
                      .series = {{.name = text, .values = {1.0}}}};
  const HeatMap map{.text = of_chart,
                    .rows = {text},
                    .columns = {text},
                    .cells = {{.value = 1.0, .label = text}}};
  const Timeline timeline{
      .text = of_chart,
      .x = {.label = text, .from = 0.0, .to = 9.0},
      .lanes = {{.label = text, .bars = {{1.0, 2.0, text}}, .marks = {{3.0, 3.0, text}}}}};
  return {chart, bars, map, ChartGrid{.text = of_chart, .charts = {chart, chart, chart}}, timeline};
}

TEST(Svg, IsWellFormedWhateverTheTexts) {
  for (const Picture& picture : pictures_with(hostile)) {
    for (const SvgUse use : {SvgUse::embedded, SvgUse::file}) {
      const std::string svg = svg_of(picture, use);
      EXPECT_EQ(test::malformed_part(svg), "") << svg;
      EXPECT_THAT(svg, Not(HasSubstr("<script")));
      EXPECT_THAT(svg, Not(HasSubstr("\x1b")));
    }
  }
}

TEST(Svg, NamesItselfForScreenReaders) {
  const std::string svg = svg_of(histogram(), SvgUse::embedded);
  EXPECT_THAT(svg, HasSubstr("role=\"img\" aria-labelledby=\"histogram-title "
                             "histogram-description\""));
  EXPECT_THAT(svg, HasSubstr("<title id=\"histogram-title\">Errors</title>"));
  EXPECT_THAT(svg, HasSubstr("<desc id=\"histogram-description\">Most are small.</desc>"));
}

TEST(Svg, TakesTheColoursOfThePage) {
  const std::string embedded = svg_of(histogram(), SvgUse::embedded);
  EXPECT_THAT(embedded, HasSubstr("fill=\"var(--chart-first,#0072b2)\""));
  EXPECT_THAT(embedded, Not(HasSubstr("<style>")));
}

TEST(Svg, CarriesItsColoursAsAFile) {
  const std::string file = svg_of(histogram(), SvgUse::file);
  EXPECT_THAT(file, HasSubstr("xmlns=\"http://www.w3.org/2000/svg\""));
  EXPECT_THAT(file, HasSubstr("fill=\"#0072b2\""));
  EXPECT_THAT(file, Not(HasSubstr("var(")));
}

// On axes whose ends are given, a bar's edges and height are linear functions of its values: the
// bar of 5 of 10 is half as high as that of 10, and all stand side by side on one line.
TEST(Bars, StandWhereTheirValuesAre) {
  const std::vector<std::string> bars =
      test::tags_of(svg_of(histogram(), SvgUse::file), "<rect[^>]* fill=\"#0072b2\"/>");
  ASSERT_THAT(bars, SizeIs(3));                                 // One is empty.
  const double unit = test::number_of(bars[0], "width") + 1.0;  // The gap between bars.
  EXPECT_NEAR(test::number_of(bars[1], "x") - test::number_of(bars[0], "x"), unit, 0.02);
  EXPECT_NEAR(test::number_of(bars[2], "x") - test::number_of(bars[0], "x"), 3.0 * unit, 0.02);
  EXPECT_NEAR(test::number_of(bars[0], "height"), 190.0, 0.02);
  EXPECT_NEAR(test::number_of(bars[1], "height"), 95.0, 0.02);
  EXPECT_NEAR(test::number_of(bars[2], "height"), 19.0, 0.02);
  const auto foot = [](const std::string& bar) {
    return test::number_of(bar, "y") + test::number_of(bar, "height");
  };
  EXPECT_NEAR(foot(bars[1]), foot(bars[0]), 0.02);
}

/// The points of the only path with this colour.
std::vector<Point> points_of(const std::string& svg, const std::string& colour) {
  const std::vector<std::string> paths =
      test::tags_of(svg, "<path d=\"[^\"]*\" fill=\"none\" stroke=\"" + colour + "\"[^>]*/>");
  EXPECT_THAT(paths, SizeIs(1));
  std::vector<Point> points;
  static const std::regex point("[ML]([-0-9.]+) ([-0-9.]+)");
  const std::string path = paths.empty() ? "" : paths[0];
  for (auto it = std::sregex_iterator(path.begin(), path.end(), point);
       it != std::sregex_iterator(); ++it) {
    points.push_back({std::stod((*it)[1]), std::stod((*it)[2])});
  }
  return points;
}

Chart curve(std::vector<Point> points, Scale scale) {
  return {.text = {.id = "curve", .title = "", .description = ""},
          .x = {.label = "n", .scale = scale, .from = 0.1, .to = 1000.0},
          .y = {.label = "std", .from = 0.0, .to = 1.0},
          .layers = {Curve{.name = "", .points = std::move(points), .ink = Ink::third}}};
}

TEST(Line, IsDrawnOfSubnormalValues) {
  Chart chart = curve({{1.0, 1e-310}, {2.0, 3e-310}}, Scale::linear);
  chart.y.to = 4e-310;
  EXPECT_THAT(points_of(svg_of(chart, SvgUse::file), "#008f68"), SizeIs(2));
}

// Powers of ten are equally far apart on a logarithmic axis, and its lower end is at the left.
TEST(Line, FollowsALogarithmicAxis) {
  const std::string svg =
      svg_of(curve({{0.1, 0.0}, {1.0, 0.5}, {10.0, 1.0}, {1000.0, 0.25}}, Scale::logarithmic),
             SvgUse::file);
  const std::vector<Point> points = points_of(svg, "#008f68");
  ASSERT_THAT(points, SizeIs(4));
  const std::vector<std::string> boxes =
      test::tags_of(svg, "<clipPath id=\"curve-clip\"><rect[^>]*>");
  ASSERT_THAT(boxes, SizeIs(1));
  EXPECT_NEAR(points[0].x, test::number_of(boxes[0], "x"), 0.02);
  const double decade = test::number_of(boxes[0], "width") / 4.0;
  EXPECT_NEAR(points[1].x - points[0].x, decade, 0.02);
  EXPECT_NEAR(points[2].x - points[1].x, decade, 0.02);
  EXPECT_NEAR(points[3].x - points[2].x, 2.0 * decade, 0.03);
  EXPECT_NEAR(points[0].y - points[1].y, 95.0, 0.02);
  EXPECT_NEAR(points[0].y - points[2].y, 190.0, 0.02);
}

TEST(Line, LeavesOutWhatHasNoPlace) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  constexpr double infinity = std::numeric_limits<double>::infinity();
  const std::string svg =
      svg_of(curve({{0.0, 0.5}, {1.0, nan}, {infinity, 0.5}, {-1.0, 0.5}}, Scale::logarithmic),
             SvgUse::file);
  EXPECT_THAT(svg, Not(HasSubstr("nan")));
  EXPECT_THAT(svg, Not(HasSubstr("inf")));
  EXPECT_THAT(test::tags_of(svg, "<path[^>]*#008f68"), SizeIs(0));
}

TEST(Chart, WithoutDataSaysSo) {
  Chart chart = histogram();
  chart.layers = {LimitLine{.label = "objective", .value = 30.0}};
  EXPECT_THAT(svg_of(chart, SvgUse::embedded), HasSubstr(">nothing to show</text>"));
  EXPECT_THAT(svg_of(histogram(), SvgUse::embedded), Not(HasSubstr("nothing to show")));
}

// Half of `−5×10⁵`, in DejaVu Sans of 13 pixels, is 25.9 wide.
TEST(Chart, CutsNoLabelOfATick) {
  Chart chart = curve({{-1e6, 0.0}, {1.2e6, 1.0}}, Scale::linear);
  chart.x.from = chart.x.to = std::nullopt;
  const std::string svg = svg_of(chart, SvgUse::file);
  const std::vector<std::string> labels =
      test::tags_of(svg, "<text[^>]*text-anchor=\"middle\">[^<]*10[⁵⁶]");
  ASSERT_THAT(labels, Not(IsEmpty()));
  double end = 0.0;
  for (const std::string& label : labels) {
    const double middle = test::number_of(label, "x");
    EXPECT_GE(middle - 25.9, end) << label;
    end = middle + 25.9;
  }
  EXPECT_LE(end, 480.0);
}

TEST(Chart, ShowsOnePointAsAMark) {
  const std::string svg = svg_of(curve({{1.0, 0.5}}, Scale::logarithmic), SvgUse::file);
  EXPECT_THAT(svg, Not(HasSubstr("nothing to show")));
  EXPECT_THAT(test::tags_of(svg, "<path[^>]*#008f68[^>]*>"), SizeIs(1));
  EXPECT_THAT(svg_of(curve({}, Scale::logarithmic), SvgUse::file),
              HasSubstr(">nothing to show</text>"));
}

TEST(Chart, NamesInItsLegendWhatIsSeenAlone) {
  Chart chart = histogram();
  chart.layers.emplace_back(Curve{.name = "inside", .points = {{5.0, 5.0}, {6.0, 6.0}}});
  chart.layers.emplace_back(Curve{.name = "beyond", .points = {{5.0, 99.0}, {6.0, 99.0}}});
  const std::string svg = svg_of(chart, SvgUse::file);
  EXPECT_THAT(svg, HasSubstr(">inside</text>"));
  EXPECT_THAT(svg, Not(HasSubstr(">beyond</text>")));
}

TEST(Chart, ShowsABarWithoutAWidth) {
  Chart chart = histogram();
  chart.layers = {Bars{.edges = {20.0, 20.0}, .heights = {5.0}}};
  const std::vector<std::string> bars =
      test::tags_of(svg_of(chart, SvgUse::file), "<rect[^>]*fill=\"#0072b2\"[^>]*>");
  ASSERT_THAT(bars, SizeIs(1));
  EXPECT_EQ(test::number_of(bars[0], "width"), 2.0);
}

// Where not all ticks have room for their labels.
TEST(Chart, HasLabelsInEqualSteps) {
  Chart chart = curve({{1.0000001, 0.0}, {1.0000007, 1.0}}, Scale::linear);
  chart.x.from = chart.x.to = std::nullopt;
  const std::string svg = svg_of(chart, SvgUse::file);
  const std::vector<std::string> labels =
      test::tags_of(svg, "<text[^>]*text-anchor=\"middle\">1[^<]*<");
  ASSERT_THAT(labels, SizeIs(testing::Ge(3U)));
  const auto place = [&](std::size_t i) { return test::number_of(labels[i], "x"); };
  for (std::size_t i = 2; i < labels.size(); ++i) {
    EXPECT_NEAR(place(i) - place(i - 1), place(1) - place(0), 0.02);
  }
}

TEST(BarChart, HasValuesAsText) {
  const BarChart chart{.text = {.id = "budget", .title = "Budget", .description = ""},
                       .x = {.label = "m/s²", .scale = Scale::logarithmic},
                       .categories = {"a", "b"},
                       .series = {{.name = "before", .values = {1e-13, 2e-14}},
                                  {.name = "after", .values = {1e-15, std::nullopt}}}};
  const std::string svg = svg_of(chart, SvgUse::file);
  EXPECT_THAT(svg, HasSubstr(">10⁻¹³</text>"));
  EXPECT_THAT(svg, HasSubstr(">2×10⁻¹⁴</text>"));
  // Two samples in the legend, three bars.
  EXPECT_THAT(test::tags_of(svg, "<rect[^>]*stroke=\"#0072b2\""), SizeIs(5));
}

// On an axis from −20 to 0, a bar of ten seconds is half as wide as the axis, and one that begins
// before its left end is cut off there. Lanes are equally far apart.
TEST(Timeline, HasBarsWhereTheirTimesAre) {
  const Timeline timeline{
      .text = {.id = "attempts", .title = "Attempts", .description = ""},
      .x = {.label = "s", .from = -20.0, .to = 0.0},
      .lanes = {
          {.label = "a", .bars = {{-10.0, 0.0, "run 1"}, {-25.0, -15.0, "run 0"}}},
          {.label = "", .bars = {{-10.0, -5.0, "run 2"}, {-40.0, -30.0, "left out"}}},
          {.label = "b", .marks = {{-10.0, -10.0, "run 3 lost"}, {-30.0, -30.0, "left out"}}}}};
  const std::string svg = svg_of(timeline, SvgUse::file);
  const std::vector<std::string> bars = test::tags_of(svg, "<rect[^>]* fill=\"#0072b2\"/>");
  ASSERT_THAT(bars, SizeIs(3));
  const auto x = [&](std::size_t i) { return test::number_of(bars[i], "x"); };
  const auto width = [&](std::size_t i) { return test::number_of(bars[i], "width"); };
  EXPECT_NEAR(x(0) - x(1), width(0), 0.02);
  EXPECT_NEAR(width(1), width(0) / 2.0, 0.02);
  EXPECT_NEAR(x(2), x(0), 0.02);
  EXPECT_NEAR(width(2), width(0) / 2.0, 0.02);
  EXPECT_NEAR(test::number_of(bars[1], "y"), test::number_of(bars[0], "y"), 0.02);
  const double lane = test::number_of(bars[2], "y") - test::number_of(bars[0], "y");
  const std::vector<std::string> losses = test::tags_of(svg, "<rect[^>]* fill=\"#d55e00\"/>");
  ASSERT_THAT(losses, SizeIs(1));
  EXPECT_NEAR(test::number_of(losses[0], "x"), x(0), 0.02);
  EXPECT_GT(test::number_of(losses[0], "y"), test::number_of(bars[2], "y") + lane / 2.0);
  EXPECT_THAT(svg, HasSubstr("<g><title>run 1</title>"));
  EXPECT_THAT(svg, Not(HasSubstr("left out")));
}

// A correlation of −1 has the colour of negative ones at full strength, which is 0.5.
TEST(HeatMap, ShowsSignAndStrength) {
  const HeatMap map{.text = {.id = "map", .title = "Correlations", .description = ""},
                    .rows = {"a"},
                    .columns = {"b", "c", "d"},
                    .cells = {{.value = -1.0, .label = "−1"}, {.value = 0.5, .label = ".5"}, {}}};
  const std::string svg = svg_of(map, SvgUse::file);
  EXPECT_THAT(svg, HasSubstr("fill=\"#d55e00\" fill-opacity=\"0.5\""));
  EXPECT_THAT(svg, HasSubstr("fill=\"#0072b2\" fill-opacity=\"0.25\""));
  EXPECT_THAT(svg, HasSubstr("fill=\"#0072b2\" fill-opacity=\"0\""));
}

double channel_of(std::string_view colour, std::size_t position) {
  const double value = std::stoi(std::string(colour.substr(position, 2)), nullptr, 16) / 255.0;
  return value <= 0.04045 ? value / 12.92 : std::pow((value + 0.055) / 1.055, 2.4);
}

/// Relative luminance of WCAG 2.2.
double luminance(std::string_view colour) {
  return 0.2126 * channel_of(colour, 1) + 0.7152 * channel_of(colour, 3) +
         0.0722 * channel_of(colour, 5);
}

/// Contrast ratio of WCAG 2.2.
double contrast(std::string_view a, std::string_view b) {
  const auto [darker, lighter] = std::minmax({luminance(a), luminance(b)});
  return (lighter + 0.05) / (darker + 0.05);
}

const ThemeColour& colour(std::string_view property) {
  return *std::ranges::find(theme_colours(), property, &ThemeColour::property);
}

TEST(Theme, InksDifferFromTheirGround) {
  const ThemeColour& ground = colour("--chart-ground");
  for (const std::string_view ink :
       {"--chart-first", "--chart-second", "--chart-third", "--chart-fourth"}) {
    EXPECT_GE(contrast(colour(ink).light, ground.light), 3.0) << ink;
    EXPECT_GE(contrast(colour(ink).dark, ground.dark), 3.0) << ink;
  }
  EXPECT_GE(contrast(colour("--chart-text").light, ground.light), 7.0);
  EXPECT_GE(contrast(colour("--chart-text").dark, ground.dark), 7.0);
}

/// A colour with an opacity of 0.5, that of the strongest cell of a heat map, on its ground.
std::string blended(std::string_view colour, std::string_view ground) {
  std::string text = "#";
  for (const std::size_t position : {1U, 3U, 5U}) {
    const auto value = [&](std::string_view of) {
      return std::stoi(std::string(of.substr(position, 2)), nullptr, 16);
    };
    char digits[3];
    std::snprintf(digits, sizeof digits, "%02x",
                  static_cast<unsigned>(std::lround(0.5 * value(colour) + 0.5 * value(ground))));
    text += digits;
  }
  return text;
}

TEST(Theme, TextIsReadableInTheStrongestCells) {
  const ThemeColour& ground = colour("--chart-ground");
  const ThemeColour& text = colour("--chart-text");
  for (const std::string_view ink : {"--chart-first", "--chart-second"}) {
    EXPECT_GE(contrast(text.light, blended(colour(ink).light, ground.light)), 4.5) << ink;
    EXPECT_GE(contrast(text.dark, blended(colour(ink).dark, ground.dark)), 4.5) << ink;
  }
}

std::vector<std::string> labels_of(const AxisRange& range) {
  std::vector<std::string> labels;
  for (const Tick& tick : range.ticks) labels.push_back(tick.label);
  return labels;
}

TEST(FigureText, HasThreeDigitsOrAllOfAWholeNumber) {
  EXPECT_EQ(figure_text(0.0), "0");
  EXPECT_EQ(figure_text(-0.0), "0");
  EXPECT_EQ(figure_text(1234.0), "1234");
  EXPECT_EQ(figure_text(-23456.7), "−23457");
  EXPECT_EQ(figure_text(0.00123456), "0.00123");
  EXPECT_EQ(figure_text(99'999.0), "10⁵");
  EXPECT_EQ(figure_text(2.5), "2.5");
  EXPECT_EQ(figure_text(1.0), "1");
}

TEST(FigureText, HasARealMinusSignAndSuperscripts) {
  EXPECT_EQ(figure_text(-0.25), "\u22120.25");
  EXPECT_EQ(figure_text(2.5e-9), "2.5×10⁻⁹");
  EXPECT_EQ(figure_text(-1e12), "\u221210¹²");
  EXPECT_EQ(figure_text(9.999e-10), "10⁻⁹");
}

TEST(FigureText, OfTablesKeepsThreeDigits) {
  EXPECT_EQ(measured_text(0.0), "0");
  EXPECT_EQ(measured_text(12.0), "12.0");
  EXPECT_EQ(measured_text(9.996), "10.0");
  EXPECT_EQ(measured_text(-0.5), "\u22120.500");
  EXPECT_EQ(measured_text(0.0012), "0.00120");
  EXPECT_EQ(measured_text(1234.0), "1234");
  EXPECT_EQ(measured_text(99'999.0), "1.00×10⁵");
  EXPECT_EQ(measured_text(-2.5e-9), "\u22122.50×10⁻⁹");
}

// Steps of 20 make 6 ticks of 0 to 100, steps of 10 would make 11.
TEST(LinearRange, HasStepsOfOneTwoOrFive) {
  EXPECT_THAT(labels_of(linear_range({}, 0.0, 100.0, 6)),
              ElementsAre("0", "20", "40", "60", "80", "100"));
  EXPECT_THAT(labels_of(linear_range({}, 0.0, 100.0, 5)), ElementsAre("0", "50", "100"));
  EXPECT_THAT(labels_of(linear_range({}, 0.0, 2.0, 5)),
              ElementsAre("0", "0.5", "1.0", "1.5", "2.0"));
  EXPECT_THAT(labels_of(linear_range({.is_count = true}, 0.0, 2.0, 5)), ElementsAre("0", "1", "2"));
  EXPECT_THAT(
      labels_of(linear_range({}, 0.0, 1.0, 11)),
      ElementsAre("0", "0.1", "0.2", "0.3", "0.4", "0.5", "0.6", "0.7", "0.8", "0.9", "1.0"));
}

TEST(LinearRange, EndsAtTicks) {
  const AxisRange range = linear_range({}, -3.2, 7.9, 8);
  EXPECT_EQ(range.from, -4.0);
  EXPECT_EQ(range.to, 8.0);
  EXPECT_THAT(labels_of(range), ElementsAre("\u22124", "\u22122", "0", "2", "4", "6", "8"));
}

TEST(LinearRange, KeepsTheEndsThatAreGiven) {
  const AxisRange range = linear_range({.from = 3.0, .to = 17.0}, -100.0, 100.0, 5);
  EXPECT_EQ(range.from, 3.0);
  EXPECT_EQ(range.to, 17.0);
  EXPECT_THAT(labels_of(range), ElementsAre("5", "10", "15"));
}

TEST(LinearRange, TellsNeighboursApart) {
  EXPECT_THAT(labels_of(linear_range({}, 1000.0, 1004.0, 6)),
              ElementsAre("1000", "1001", "1002", "1003", "1004"));
  EXPECT_THAT(labels_of(linear_range({}, 0.0, 2e-9, 5)),
              ElementsAre("0", "5×10⁻¹⁰", "10⁻⁹", "1.5×10⁻⁹", "2×10⁻⁹"));
}

TEST(LinearRange, HoldsAnyData) {
  for (const auto& [from, to] : std::vector<std::pair<double, double>>{
           {0.0, 0.0}, {5.0, 5.0}, {-1e90, 1e90}, {1e-300, 2e-300}, {1e15, 1e15 + 0.25}}) {
    const AxisRange range = linear_range({}, from, to, 6);
    EXPECT_LE(range.from, from);
    EXPECT_GE(range.to, to);
    EXPECT_GT(range.to, range.from);
    EXPECT_LE(range.ticks.size(), 6U);
    EXPECT_GE(range.ticks.size(), 2U);
  }
}

TEST(LogarithmicRange, HasPowersOfTen) {
  const ChartAxis axis{.scale = Scale::logarithmic};
  EXPECT_THAT(labels_of(logarithmic_range(axis, 0.1, 1000.0, 8)),
              ElementsAre("0.1", "1", "10", "100", "1000"));
  EXPECT_THAT(labels_of(logarithmic_range(axis, 1e-16, 1e-13, 8)),
              ElementsAre("10⁻¹⁶", "10⁻¹⁵", "10⁻¹⁴", "10⁻¹³"));
}

TEST(LogarithmicRange, LeavesOutPowersWhereTheyAreMany) {
  const ChartAxis axis{.scale = Scale::logarithmic};
  EXPECT_THAT(labels_of(logarithmic_range(axis, 1e-12, 1.0, 5)),
              ElementsAre("10⁻¹²", "10⁻⁹", "10⁻⁶", "0.001", "1"));
  EXPECT_THAT(
      labels_of(logarithmic_range({.scale = Scale::logarithmic, .from = 5.0}, 5.0, 1000.0, 2)),
      ElementsAre("10", "1000"));
}

TEST(LogarithmicRange, DividesFewPowersByTwoAndFive) {
  const ChartAxis axis{.scale = Scale::logarithmic};
  const AxisRange range = logarithmic_range(axis, 130.0, 900.0, 8);
  EXPECT_EQ(range.from, 100.0);
  EXPECT_EQ(range.to, 1000.0);
  EXPECT_THAT(labels_of(range), ElementsAre("100", "200", "500", "1000"));
}

TEST(LogarithmicRange, IgnoresAnEndThatHasNoPlace) {
  const AxisRange range =
      logarithmic_range({.scale = Scale::logarithmic, .from = 0.0}, 2.0, 2.0, 8);
  EXPECT_EQ(range.from, 2.0);
  EXPECT_GT(range.to, range.from);
}

}  // namespace
}  // namespace proofmass::coordinator
