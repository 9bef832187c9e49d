#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "coordinator/charts/chart.hpp"

namespace proofmass::coordinator {

/// Where a picture is shown.
enum class SvgUse : std::uint8_t {
  /// In an HTML page, which sets the colours with light_colours() and dark_colours(). Without them,
  /// they are the light ones.
  embedded,
  /// As a file: with its namespace, its style and its ground. It follows `prefers-color-scheme`.
  standalone,
  /// As a file for programs that know neither custom properties nor media queries, such as those
  /// that make a bitmap of it: the light colours stand at each element.
  plain,
};

/// The picture as SVG, the same bytes for the same picture. All texts of all pictures have one
/// size. In a page, a picture 480 wide takes 440 pixels; texts are still readable at 360. For
/// screen readers it is one image with title and description.
///
/// Data that are not finite, or not above 0 on a logarithmic axis, are left out. Without data the
/// axes are drawn with `no data` between them.
[[nodiscard]] std::string svg_of(const Picture& picture, SvgUse use);

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

}  // namespace proofmass::coordinator
