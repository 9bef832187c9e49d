#include "proto/text/display_width.hpp"

#include <gtest/gtest.h>

namespace proofmass::wire {
namespace {

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
