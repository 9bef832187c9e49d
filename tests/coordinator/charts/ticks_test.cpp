#include "coordinator/charts/ticks.hpp"

#include <gmock/gmock.h>

#include <string>
#include <vector>

namespace proofmass::coordinator {
namespace {

using ::testing::ElementsAre;

std::vector<std::string> labels_of(const AxisRange& range) {
  std::vector<std::string> labels;
  for (const Tick& tick : range.ticks) labels.push_back(tick.label);
  return labels;
}

TEST(FigureText, HasThreeDigitsAtMost) {
  EXPECT_EQ(figure_text(0.0), "0");
  EXPECT_EQ(figure_text(-0.0), "0");
  EXPECT_EQ(figure_text(1234.0), "1230");
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

// Steps of 20 make 6 ticks of 0 to 100, steps of 10 would make 11.
TEST(LinearRange, HasStepsOfOneTwoOrFive) {
  EXPECT_THAT(labels_of(linear_range({}, 0.0, 100.0, 6)),
              ElementsAre("0", "20", "40", "60", "80", "100"));
  EXPECT_THAT(labels_of(linear_range({}, 0.0, 100.0, 5)), ElementsAre("0", "50", "100"));
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
  const Axis axis{.scale = Scale::logarithmic};
  EXPECT_THAT(labels_of(logarithmic_range(axis, 0.1, 1000.0, 8)),
              ElementsAre("0.1", "1", "10", "100", "1000"));
  EXPECT_THAT(labels_of(logarithmic_range(axis, 1e-16, 1e-13, 8)),
              ElementsAre("10⁻¹⁶", "10⁻¹⁵", "10⁻¹⁴", "10⁻¹³"));
}

TEST(LogarithmicRange, LeavesOutPowersWhereTheyAreMany) {
  const Axis axis{.scale = Scale::logarithmic};
  EXPECT_THAT(labels_of(logarithmic_range(axis, 1e-12, 1.0, 5)),
              ElementsAre("10⁻¹²", "10⁻⁹", "10⁻⁶", "0.001", "1"));
}

TEST(LogarithmicRange, DividesFewPowersByTwoAndFive) {
  const Axis axis{.scale = Scale::logarithmic};
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
