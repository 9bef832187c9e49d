#include "coordinator/table/terminal_table.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "coordinator/table/document_table.hpp"
#include "coordinator/table/figures.hpp"

namespace proofmass::coordinator {
namespace {

const std::string bad = "\033[1;38;5;130m";
const std::string bold = "\033[1m";
const std::string plain = "\033[0m";

Table named_runs(std::vector<Row> rows) {
  return {.columns = {{"name", true, 6}, {"runs", false, 6}}, .rows = std::move(rows)};
}

TEST(Alignment, FillsUpWithSpaces) {
  EXPECT_EQ(left_aligned("Δx", 4), "Δx  ");
  EXPECT_EQ(right_aligned("Δx", 4), "  Δx");
  EXPECT_EQ(left_aligned("Δxyz", 2), "Δxyz") << "cuts nothing";
  EXPECT_EQ(horizontal_rule(3), "───");
}

TEST(TerminalTable, KeepsASpaceBetweenColumns) {
  EXPECT_EQ(terminal_text(named_runs({{"Δx", "12"}, {"a", ""}})),
            "name    runs\n────────────\nΔx        12\na\n");
}

TEST(TerminalTable, WidensItsColumnsForLongCells) {
  EXPECT_EQ(terminal_text(named_runs({{"calibration", "1234567"}})),
            "name            runs\n────────────────────\ncalibration  1234567\n");
}

TEST(TerminalTable, CutsTextAndNoNumberWhereTheLineHasNoRoom) {
  EXPECT_EQ(terminal_text(named_runs({{"calibration", "12"}}), {.line_width_max = 15}),
            "name       runs\n───────────────\ncalibra…     12\n");
  EXPECT_EQ(terminal_text(named_runs({{"a", "1234567"}}), {.line_width_max = 5}),
            "name      runs\n──────────────\na      1234567\n");
}

TEST(TerminalTable, PutsAWideTextAboveItsRowIfAsked) {
  Table table = named_runs({{"calibration", "12"}, {"a", "3"}});
  table.columns[0].has_lines_of_its_own = true;
  EXPECT_EQ(terminal_text(table),
            "name    runs\n────────────\ncalibration\n          12\na          3\n");
}

TEST(TerminalTable, HasGroupsVerticalLinesAndATotal) {
  const Table table{.columns = {{"name", true, 6},
                                {"mean", false, 6, "this"},
                                {"std", false, 6, "this"},
                                {"hidden", false, 6, "this", false, true},
                                {"mean", false, 6, "this", true},
                                {"", true, 2}},
                    .rows = {{"a", "1", "2", "x", "3", " *"}, {"sum", "4", "5", "y", "6", ""}},
                    .has_total = true};
  EXPECT_EQ(terminal_text(table),
            "          this    │ this\n"
            "name    mean  std │  mean\n"
            "──────────────────┼──────\n"
            "a          1    2 │     3 *\n"
            "──────────────────┼──────\n"
            "sum        4    5 │     6\n");
}

TEST(TerminalTable, HasACaptionRemarksAndSentences) {
  Table table = named_runs({});
  table.caption = "runs";
  table.remarks = {{"a: " + std::string(80, 'x')}};
  table.notes = {std::string(74, 'n') + " wraps at 80"};
  EXPECT_EQ(terminal_text(table, {.line_width_max = 20, .cuts_remarks = true}),
            "runs\n\nname    runs\n────────────\na: xxxxxxxxxxxxxxxx…\n" + std::string(74, 'n') +
                " wraps\n  at 80\n");
  EXPECT_NE(terminal_text(table).find("\na: " + std::string(80, 'x') + "\n"), std::string::npos);
}

TEST(TerminalTable, PaintsTonesAndChangesNoBlank) {
  Table table = named_runs({{"a", "2"}});
  table.rows[0][1].tone = Tone::bad;
  table.remarks = {{"a: lost", Tone::bad}};
  EXPECT_EQ(terminal_text(table, {.paint = Paint::yes}),
            bold + "name    runs" + plain + "\n────────────\na          " + bad + "2" + plain +
                "\n" + bad + "a: lost" + plain + "\n");
}

TEST(TerminalTable, ShowsControlCharacters) {
  const Table table{.caption = "\x1b[2J",
                    .columns = {{"\x1b[2J", true}},
                    .rows = {{"\x1b[2J"}},
                    .remarks = {{"\x1b[2J"}},
                    .notes = {"\x1b[2J"}};
  const std::string text = terminal_text(table, {.paint = Paint::no});
  EXPECT_EQ(text.find('\x1b'), std::string::npos) << text;
  EXPECT_EQ(markdown_table(table).find('\x1b'), std::string::npos);
}

TEST(MarkdownTable, EscapesWhatMarkdownReads) {
  const Table table{.caption = "*a*",
                    .columns = {{"_a_b_", true}, {"n", false, 0, "|g|"}},
                    .rows = {{"<i>", "1"}},
                    .notes = {"`x`"}};
  EXPECT_EQ(markdown_table(table),
            "**\\*a\\***\n\n| \\_a_b\\_ | \\|g\\|: n |\n| --- | ---: |\n| \\<i\\> | 1 |\n\n"
            "\\`x\\`\n\n");
}

// The palette of xterm, and the contrast of two lights by WCAG 2.
double light_of(int colour) {
  const auto linear = [](int level) {
    const double value = (level == 0 ? 0.0 : 55.0 + 40.0 * level) / 255.0;
    return value <= 0.03928 ? value / 12.92 : std::pow((value + 0.055) / 1.055, 2.4);
  };
  const int cube = colour - 16;
  return 0.2126 * linear(cube / 36) + 0.7152 * linear(cube / 6 % 6) + 0.0722 * linear(cube % 6);
}

TEST(Tone, IsReadableOnBlackAndOnWhite) {
  for (const Tone tone : {Tone::good, Tone::open, Tone::bad}) {
    const double light = light_of(colour_of(tone));
    EXPECT_GT((light + 0.05) / 0.05, 4.0) << colour_of(tone);
    EXPECT_GT(1.05 / (light + 0.05), 4.0) << colour_of(tone);
  }
  EXPECT_EQ(colour_of(Tone::heading), 0) << "the terminal's own";
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
