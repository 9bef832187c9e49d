#pragma once

#include <string>
#include <string_view>

#include "coordinator/charts/chart.hpp"
#include "coordinator/charts/svg.hpp"

namespace proofmass::coordinator {

/// A coordinate with at most two decimals, and as few as it takes.
[[nodiscard]] std::string coordinate(double value);

enum class Anchor : std::uint8_t { start, middle, end };

struct TextStyle {
  Anchor anchor = Anchor::start;
  bool is_bold = false;
  double rotation = 0.0;  ///< Degrees, clockwise, about the place of the text.
};

/// The height of all texts.
inline constexpr double text_size = 13.0;

/// Width of a text by the mean width of letters, about 5 % too large for most.
[[nodiscard]] double text_width(std::string_view text);

struct Box {
  double left = 0.0;
  double top = 0.0;
  double width = 0.0;
  double height = 0.0;

  [[nodiscard]] double right() const { return left + width; }
  [[nodiscard]] double bottom() const { return top + height; }
};

/// How an outline is drawn.
struct Stroke {
  std::string colour;
  double width = 1.0;
  Dash dash = Dash::solid;
};

/// Elements of SVG, one after the other. Coordinates are those of the picture, y downwards.
class SvgWriter {
 public:
  explicit SvgWriter(SvgUse use) : use_(use) {}

  /// As a value of `fill` or `stroke`.
  [[nodiscard]] std::string colour(std::string_view property) const;
  [[nodiscard]] std::string colour(Ink ink) const;

  /// @param place  Of the start, middle or end of the text's baseline.
  void text(Point place, std::string_view text, const TextStyle& style = {});
  void rectangle(const Box& box, std::string_view fill);
  void outlined_rectangle(const Box& box, std::string_view fill, double opacity,
                          const Stroke& stroke);
  void line(Point from, Point to, const Stroke& stroke);
  /// @param path  Data of a path, `M0 0L1 1`.
  void outline(std::string_view path, const Stroke& stroke);
  void area(std::string_view path, std::string_view fill, double opacity);
  void marker(Point centre, Shape shape, Ink ink);

  /// What is drawn until end_group() shows this text under the pointer.
  void begin_group(std::string_view tooltip);
  void end_group() { markup_ += "</g>\n"; }

  void raw(std::string_view markup) { markup_ += markup; }
  [[nodiscard]] const std::string& markup() const { return markup_; }

 private:
  SvgUse use_;
  std::string markup_;
};

}  // namespace proofmass::coordinator
