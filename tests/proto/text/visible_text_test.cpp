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

}  // namespace
}  // namespace proofmass::wire
