#include "coordinator/charts/theme.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <string>
#include <string_view>

namespace proofmass::coordinator {
namespace {

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

TEST(Contrast, IsThatOfBlackOnWhite) { EXPECT_NEAR(contrast("#000000", "#ffffff"), 21.0, 1e-9); }

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

TEST(Theme, IsDeclaredForBothGrounds) {
  EXPECT_THAT(light_colours(), testing::HasSubstr("--chart-first:#0072b2;"));
  EXPECT_THAT(dark_colours(), testing::HasSubstr("--chart-first:#56b4e9;"));
  EXPECT_THAT(standalone_style(), testing::HasSubstr("@media (prefers-color-scheme:dark)"));
}

}  // namespace
}  // namespace proofmass::coordinator
