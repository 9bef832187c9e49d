#include "coordinator/table/table.hpp"

#include "tests/coordinator/charts/markup_reading.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

const std::string hostile = "<script>alert(\"1\")</script> & 'x'";

/// The table of a report with this text wherever a text is shown.
Table review_table(const std::string& text) {
  return {.id = "table",
          .caption = text,
          .columns = {{text, true}, {"lower", false, 0, text}, {"upper", false, 0, text}},
          .rows = {{text, {"1.23e-4", 1.2345e-4}, {text, Tone::bad}}},
          .remarks = {{text}},
          .notes = {text}};
}

TEST(HtmlTables, EscapeWhateverTheTextsAre) {
  const std::string html = html_table(review_table(hostile));
  EXPECT_EQ(test::malformed_part(html), "");
  EXPECT_THAT(html, Not(HasSubstr("<script")));
}

TEST(HtmlTables, HoldValuesInFullPrecisionForPrograms) {
  EXPECT_THAT(html_table(review_table("a")), HasSubstr("data-value=\"0.00012345\">1.23e-4</td>"));
}

TEST(HtmlTables, HaveHeadingsOverTheirColumnsAndRows) {
  const std::string html = html_table(review_table("a"));
  EXPECT_THAT(html, AllOf(HasSubstr("<th scope=\"colgroup\" colspan=\"2\">a</th>"),
                          HasSubstr("<th scope=\"row\" class=\"words\">a</th>"),
                          HasSubstr("aria-labelledby=\"table-caption\""),
                          HasSubstr("<caption id=\"table-caption\">a</caption>")));
}

TEST(HtmlTables, TellTonesByAClassBesideTheWords) {
  EXPECT_THAT(html_table(review_table("a")), HasSubstr("<strong class=\"unmet\">a</strong>"));
}

TEST(HtmlTables, SayHowTheyAreSorted) {
  Table table{.caption = "Workers",
              .columns = {{"name", true}, {.title = "results", .sort = "descending"}},
              .rows = {{"w", "7"}}};
  table.rows[0][1].markup = "<b>7</b>";
  const std::string html = html_table(table);
  EXPECT_EQ(test::malformed_part(html), "");
  EXPECT_THAT(test::tags_of(html, "<th [^>]*>"),
              ElementsAre("<th scope=\"col\" class=\"words\">",
                          "<th scope=\"col\" aria-sort=\"descending\">",
                          "<th scope=\"row\" class=\"words\">"));
  EXPECT_THAT(html, AllOf(HasSubstr("aria-label=\"Workers\""), HasSubstr("<td><b>7</b></td>"),
                          Not(HasSubstr("<caption"))));
}

const std::string bad = "\033[1;38;5;130m";

Table named_runs(std::vector<Row> rows) {
  return {.columns = {{"name", true, 6}, {"runs", false, 6}}, .rows = std::move(rows)};
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

TEST(TerminalTable, GoesOnBelowWhereADocumentHasNoRoom) {
  const Table table = named_runs({{"a calibration/of-it", "12"}, {"b", "3"}});
  EXPECT_EQ(terminal_text(table, {.line_width_max = 15, .wraps_cells = true}),
            "name       runs\n───────────────\na            12\ncalibrati\non/of-it\n"
            "b             3\n");
  EXPECT_EQ(terminal_text(table, document_style(Paint::no)),
            "name                  runs\n──────────────────────────\n"
            "a calibration/of-it     12\nb                        3\n");
}

TEST(TerminalTable, KeepsItsLinesWhereNumbersAndHeadingsAreWide) {
  const Table table{.columns = {{"a", true, 3},
                                {"from", false, 7},
                                {"to", false, 7},
                                {"b", false, 4, "long group", true}},
                    .rows = {{"S", "4.8e-04", "5.5e-04", "1"}}};
  EXPECT_EQ(terminal_text(table),
            "                   │long group\n"
            "a      from     to │         b\n"
            "───────────────────┼──────────\n"
            "S   4.8e-04 5.5e-04│         1\n");
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

TEST(Fitted, BreaksLinesThatATerminalHasNoRoomForBelowTheirBeginning) {
  const std::string short_line = "Label     " + std::string(70, 'a') + "\n";
  EXPECT_EQ(fitted(short_line), short_line);
  EXPECT_EQ(fitted("Label     " + std::string(69, 'a') + " b\nnext\n"),
            "Label     " + std::string(69, 'a') + "\n          b\nnext\n");
  EXPECT_EQ(fitted("    " + std::string(75, 'a') + " b"),
            "    " + std::string(75, 'a') + "\n      b\n");
  EXPECT_EQ(fitted(std::string(90, 'a') + " b"),
            std::string(79, 'a') + "\n  " + std::string(11, 'a') + "\n  b\n");
  EXPECT_EQ(fitted(std::string(90, ' ')), std::string(90, ' ') + "\n");
}

// People copy it.
TEST(Fitted, BreaksNoWordOfACommand) {
  const std::string file(90, 'f'), other(85, 'o');
  EXPECT_EQ(
      fitted("Losses    not tried; see `proofmass plan " + file + " --db " + other + "` of it"),
      "Losses    not tried; see `proofmass plan\n          " + file + "\n          --db\n" +
          "          " + other + "`\n          of it\n");
  EXPECT_EQ(fitted("run `" + file + "` " + other),
            "run\n  `" + file + "`\n  " + other.substr(0, 77) + "\n  " + other.substr(77) + "\n");
}

TEST(SentenceMarkup, ShowsCommandsAsCode) {
  EXPECT_EQ(sentence_markup("run `a <b>` or `c`: it's"),
            "run <code>a &lt;b&gt;</code> or <code>c</code>: it&#39;s");
  EXPECT_EQ(sentence_markup("a `b"), "a `b");
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

}  // namespace
}  // namespace proofmass::coordinator
