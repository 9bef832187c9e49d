#include "proto/text/visible_text.hpp"

#include <gtest/gtest.h>

namespace proofmass::wire {
namespace {

TEST(VisibleText, ShowsWhatWouldSteerATerminal) {
  EXPECT_EQ(visible_text("a\tb\nc\rd"), "a\\tb\\nc\\rd");
  EXPECT_EQ(visible_text("\x1b[31mred\x7f"), "\\u001b[31mred\\u007f");
  EXPECT_EQ(visible_text("\xc2\x9b"), "\\u009b");    // CSI as one character.
  EXPECT_EQ(visible_text("a\u202eb"), "a\\u202eb");  // Turns the direction of writing.
  EXPECT_EQ(visible_text("s²/m Δ 測"), "s²/m Δ 測");
}

TEST(VisibleText, ShowsBytesThatAreNotUtf8) {
  EXPECT_EQ(visible_text("\xff"), "\\xff");
  EXPECT_EQ(visible_text("\xe6\xb8"), "\\xe6\\xb8");                    // Ends within a character.
  EXPECT_EQ(visible_text("\xc0\xaf"), "\\xc0\\xaf");                    // Longer than need be.
  EXPECT_EQ(visible_text("\xed\xa0\x80"), "\\xed\\xa0\\x80");           // Half of a surrogate pair.
  EXPECT_EQ(visible_text("\xf4\x90\x80\x80"), "\\xf4\\x90\\x80\\x80");  // Beyond Unicode.
}

TEST(VisibleText, KeepsTheEndsOfLinesOfLongerText) {
  EXPECT_EQ(visible_lines("one\r\n\ntwo\x1b\n"), "one\\r\n\ntwo\\u001b\n");
  EXPECT_EQ(visible_lines(""), "");
}

TEST(MarkupText, CannotLeaveItsPlaceInADocument) {
  EXPECT_EQ(markup_text("<script>alert('1')</script>"),
            "&lt;script&gt;alert(&#39;1&#39;)&lt;/script&gt;");
  EXPECT_EQ(markup_text("\" onload=\"x"), "&quot; onload=&quot;x");
  EXPECT_EQ(markup_text("&lt;"), "&amp;lt;");
  EXPECT_EQ(markup_text("Δx\n\x1b[31m\xff"), "Δx\\n\\u001b[31m\\xff");
}

TEST(DisplayWidth, CountsColumnsOfATerminal) {
  EXPECT_EQ(display_width("a_c11·Δx"), 8u);
  EXPECT_EQ(display_width("│─−µ"), 4u);
  EXPECT_EQ(display_width("s²/m"), 4u);
  EXPECT_EQ(display_width("測定"), 4u);
  EXPECT_EQ(display_width("e\u0301"), 1u);  // A combining accent.
  EXPECT_EQ(display_width("🛰"), 2u);
  EXPECT_EQ(display_width(""), 0u);
}

TEST(ShortenedText, IsCutBetweenCharacters) {
  EXPECT_EQ(shortened("calibration", 11), "calibration");
  EXPECT_EQ(shortened("calibration", 6), "calib…");
  EXPECT_EQ(shortened("測定値", 6), "測定値");
  EXPECT_EQ(shortened("測定値", 5), "測定…");
  EXPECT_EQ(shortened("測定値", 4), "測…");
  EXPECT_EQ(shortened("─────", 3), "──…");
  EXPECT_EQ(shortened("ab", 1), "…");
}

}  // namespace

}  // namespace proofmass::wire
