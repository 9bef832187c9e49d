#pragma once

#include <span>
#include <string>
#include <string_view>

namespace proofmass::coordinator {

/// A colour of charts, as custom property of CSS and as what it is on a light and a dark ground.
struct ThemeColour {
  std::string_view property;  ///< `--chart-first`.
  std::string_view light;     ///< `#0072b2`.
  std::string_view dark;
};

/// Ground, text, grid, and the four inks [Okabe and Ito 2008]. Text has a contrast of 7:1 against
/// its ground at least, the inks 3:1; the grid is only for the eye and may be fainter.
[[nodiscard]] std::span<const ThemeColour> theme_colours();

/// Declarations `--chart-ground:#ffffff;...` for the rule of a page that embeds charts.
[[nodiscard]] std::string light_colours();
[[nodiscard]] std::string dark_colours();

/// The style of a picture that stands alone: light, and dark for readers who prefer that.
[[nodiscard]] std::string standalone_style();

}  // namespace proofmass::coordinator
