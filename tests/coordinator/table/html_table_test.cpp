#include <gmock/gmock.h>

#include "coordinator/table/document_table.hpp"
#include "tests/coordinator/charts/markup_reading.hpp"

namespace proofmass::coordinator {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

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

}  // namespace
}  // namespace proofmass::coordinator
