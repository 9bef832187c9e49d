#include "coordinator/charts/theme.hpp"

#include <fmt/format.h>

#include <array>

namespace proofmass::coordinator {
namespace {

// The first inks are those of Okabe and Ito that differ from either ground by 3:1; on the light
// one these are the darker half of the palette.
constexpr std::array<ThemeColour, 7> colours{{{"--chart-ground", "#ffffff", "#14171c"},
                                              {"--chart-text", "#1d2228", "#e8eaed"},
                                              {"--chart-grid", "#d7dbe0", "#3a4048"},
                                              {"--chart-first", "#0072b2", "#56b4e9"},
                                              {"--chart-second", "#d55e00", "#e69f00"},
                                              {"--chart-third", "#008f68", "#009e73"},
                                              {"--chart-fourth", "#b0568a", "#cc79a7"}}};

std::string declarations(std::string_view ThemeColour::*ground) {
  std::string text;
  for (const ThemeColour& colour : colours) {
    text += fmt::format("{}:{};", colour.property, colour.*ground);
  }
  return text;
}

}  // namespace

std::span<const ThemeColour> theme_colours() { return colours; }

std::string light_colours() { return declarations(&ThemeColour::light); }

std::string dark_colours() { return declarations(&ThemeColour::dark); }

std::string standalone_style() {
  return fmt::format(
      "<style>svg{{{}}}@media (prefers-color-scheme:dark){{svg{{{}}}}}"
      "@media print{{svg{{{}}}}}</style>",
      light_colours(), dark_colours(), light_colours());
}

}  // namespace proofmass::coordinator
