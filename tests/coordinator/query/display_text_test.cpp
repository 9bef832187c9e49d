#include "coordinator/query/display_text.hpp"

#include <gtest/gtest.h>

namespace proofmass::coordinator {
namespace {

TEST(DisplayText, CountsColumnsOfATerminal) {
  EXPECT_EQ(display_width("s²/m"), 4u);
  EXPECT_EQ(display_width("測定"), 4u);
  EXPECT_EQ(display_width("e\u0301"), 1u);  // A combining accent.
  EXPECT_EQ(display_width("🛰"), 2u);
  EXPECT_EQ(display_width(""), 0u);
}

TEST(DisplayText, IsCutBetweenCharacters) {
  EXPECT_EQ(shortened_text("calibration", 11), "calibration");
  EXPECT_EQ(shortened_text("calibration", 6), "calib…");
  EXPECT_EQ(shortened_text("測定値", 6), "測定値");
  EXPECT_EQ(shortened_text("測定値", 5), "測定…");
  EXPECT_EQ(shortened_text("測定値", 4), "測…");
  EXPECT_EQ(shortened_text("ab", 1), "…");
}

}  // namespace
}  // namespace proofmass::coordinator
