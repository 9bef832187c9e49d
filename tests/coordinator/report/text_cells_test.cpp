#include "coordinator/report/text_cells.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <string>

namespace proofmass::coordinator {
namespace {

TEST(Alignment, FillsUpWithSpaces) {
  EXPECT_EQ(left_aligned("Δx", 4), "Δx  ");
  EXPECT_EQ(right_aligned("Δx", 4), "  Δx");
  EXPECT_EQ(horizontal_rule(3), "───");
}

TEST(Alignment, CutsNothing) {
  EXPECT_EQ(left_aligned("Δxyz", 2), "Δxyz");
  EXPECT_EQ(right_aligned("Δxyz", 2), "Δxyz");
}

TEST(Table, KeepsASpaceBetweenColumns) {
  const std::array<TextColumn, 2> columns{{{"name", 6, true}, {"runs", 6}}};
  EXPECT_EQ(table_heading(columns), "name    runs\n────────────\n");
  EXPECT_EQ(table_row(columns, std::array<std::string, 2>{"Δx", "12"}), "Δx        12\n");
  EXPECT_EQ(table_row(columns, std::array<std::string, 2>{"calibration", "1234567"}),
            "cali…  1234…\n");
  EXPECT_EQ(table_row(columns, std::array<std::string, 2>{"a", ""}), "a\n");
}

TEST(Table, KeepsAWideCellOnRequest) {
  const std::array<TextColumn, 2> columns{{{"name", 6, true}, {"runs", 6}}};
  EXPECT_EQ(
      table_row(columns, std::array<std::string, 2>{"calibration", "1234567"}, WideCell::keep),
      "calibration1234567\n");
}

TEST(Table, HasGroupsAndVerticalLines) {
  constexpr std::array<TextColumn, 5> columns{{{"name", 6, true},
                                               {"mean", 6, false, "this"},
                                               {"std", 6, false, "this"},
                                               {"mean", 6, false, "this", true},
                                               {"", 2, true}}};
  EXPECT_EQ(table_heading(columns),
            "          this    │ this\n"
            "name    mean  std │  mean\n"
            "──────────────────┼──────\n");
  EXPECT_EQ(
      table_row(columns, std::array<std::string, 5>{"a", "1", "2", "3", " *"}, WideCell::keep),
      "a          1    2 │     3 *\n");
  EXPECT_EQ(table_rule(columns), "──────────────────┼──────\n");
}

TEST(LineOf, BreaksWhatATerminalHasNoRoomFor) {
  const std::string first(40, 'a');
  const std::string second = std::string(37, 'b').append("² ");
  EXPECT_EQ(line_of(first, second, 4), first + " " + second + "\n");
  EXPECT_EQ(line_of(first, std::string(40, 'b'), 4),
            first + "\n    " + std::string(40, 'b') + "\n");
}

TEST(MeasuredFigure, HasThreeSignificantDigits) {
  EXPECT_EQ(measured_figure(0.0), "0");
  EXPECT_EQ(measured_figure(0.0012345), "0.00123");
  EXPECT_EQ(measured_figure(0.36), "0.360");
  EXPECT_EQ(measured_figure(7.526), "7.53");
  EXPECT_EQ(measured_figure(49.24), "49.2");
  EXPECT_EQ(measured_figure(124.4), "124");
  EXPECT_EQ(measured_figure(1239.6), "1240");
}

TEST(MeasuredFigure, CarriesIntoTheNextDecade) {
  EXPECT_EQ(measured_figure(9.996), "10.0");
  EXPECT_EQ(measured_figure(99.96), "100");
  EXPECT_EQ(measured_figure(999'999.6), "1.0e+06");
}

TEST(MeasuredFigure, HasAtMostSevenCharactersBelow1e99) {
  for (int exponent = -99; exponent < 99; ++exponent) {
    for (const double mantissa : {1.0, 1.2345, 9.9949, 9.9996}) {
      const std::string figure = measured_figure(mantissa * std::pow(10.0, exponent));
      EXPECT_LE(figure.size(), 7u) << figure;
    }
  }
}

TEST(SignedFigure, HasASignIfItIsBelowZero) {
  EXPECT_EQ(signed_figure(-7.526), "-7.53");
  EXPECT_EQ(signed_figure(7.526), "7.53");
  EXPECT_EQ(signed_figure(-0.0), "0");
}

TEST(GivenFigure, HasNoZerosThatSayNothing) {
  EXPECT_EQ(given_figure(2000.0), "2000");
  EXPECT_EQ(given_figure(7.3), "7.3");
  EXPECT_EQ(given_figure(5.0), "5");
  EXPECT_EQ(given_figure(0.83), "0.83");
  EXPECT_EQ(given_figure(0.04e-6 / 1e-9), "40");
  EXPECT_EQ(given_figure(1e7), "1.0e+07");
}

}  // namespace
}  // namespace proofmass::coordinator
