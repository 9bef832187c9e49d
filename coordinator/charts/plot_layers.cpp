#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "coordinator/charts/plot.hpp"

namespace proofmass::coordinator {
namespace {

std::string place_text(char command, double x, double y) {
  return command + coordinate(x) + " " + coordinate(y);
}

void draw(const Bars& bars, const PlotArea& area, SvgWriter& writer) {
  const std::size_t count =
      std::min(bars.heights.size(), bars.edges.empty() ? 0 : bars.edges.size() - 1);
  for (std::size_t i = 0; i < count; ++i) {
    if (!(bars.heights[i] > 0.0) || !area.y.has(bars.heights[i])) continue;
    const double left = std::max(area.x.at(bars.edges[i]), area.box.left);
    const double right = std::min(area.x.at(bars.edges[i + 1]), area.box.right());
    const double top = std::max(area.y.at(bars.heights[i]), area.box.top);
    if (!(right > left)) continue;
    // A gap between neighbours, which else would look like one bar.
    const double gap = right - left > 3.0 ? 1.0 : 0.0;
    writer.rectangle({left, top, right - left - gap, area.box.bottom() - top},
                     writer.colour(bars.ink));
  }
}

void draw(const Line& line, const PlotArea& area, SvgWriter& writer) {
  std::string path;
  bool is_begun = false;
  for (const Point& point : line.points) {
    if (!area.x.has(point.x) || !area.y.has(point.y)) {
      is_begun = false;
      continue;
    }
    path += place_text(is_begun ? 'L' : 'M', area.x.at(point.x), area.y.at(point.y));
    is_begun = true;
  }
  if (path.empty()) return;
  writer.outline(path, {.colour = writer.colour(line.ink), .width = 2.0, .dash = line.dash});
}

void draw(const Markers& markers, const PlotArea& area, SvgWriter& writer) {
  for (std::size_t i = 0; i < markers.points.size(); ++i) {
    const Point& point = markers.points[i];
    if (!area.x.contains(point.x) || !area.y.contains(point.y)) continue;
    const Point centre{area.x.at(point.x), area.y.at(point.y)};
    writer.marker(centre, markers.shape, markers.ink);
    if (i >= markers.labels.size()) continue;
    const bool is_left = centre.x < area.box.left + 0.6 * area.box.width;
    writer.text({centre.x + (is_left ? 8.0 : -8.0), centre.y - 4.0}, markers.labels[i],
                {.anchor = is_left ? Anchor::start : Anchor::end});
  }
}

void draw(const Band& band, const PlotArea& area, SvgWriter& writer) {
  std::string upper;
  std::string lower;
  for (const BandPoint& point : band.points) {
    const bool is_finite = std::isfinite(point.lower) && std::isfinite(point.upper);
    if (!area.x.has(point.x) || !is_finite) continue;
    const double x = area.x.at(point.x);
    upper += place_text(upper.empty() ? 'M' : 'L', x, area.y.at(point.upper));
    lower = place_text('L', x, area.y.at(point.lower)) + lower;
  }
  if (upper.empty()) return;
  writer.area(upper + lower + "Z", writer.colour(band.ink), 0.25);
}

/// A vertical line has its label above the box, where draw_chart() writes it.
void draw(const LimitLine& limit, const PlotArea& area, SvgWriter& writer) {
  const Stroke stroke{.colour = writer.colour(limit.ink), .width = 2.0, .dash = limit.dash};
  if (limit.direction == LimitLine::Direction::vertical) {
    if (!area.x.contains(limit.value)) return;
    const double x = area.x.at(limit.value);
    writer.line({x, area.box.top}, {x, area.box.bottom()}, stroke);
    return;
  }
  if (!area.y.contains(limit.value)) return;
  const double y = area.y.at(limit.value);
  writer.line({area.box.left, y}, {area.box.right(), y}, stroke);
  const double above = y - 5.0 > area.box.top + text_size ? y - 5.0 : y + text_size + 2.0;
  writer.text({area.box.right() - 2.0, above}, limit.label, {.anchor = Anchor::end});
}

}  // namespace

void draw_layer(const Layer& layer, const PlotArea& area, SvgWriter& writer) {
  std::visit([&](const auto& shown) { draw(shown, area, writer); }, layer);
}

}  // namespace proofmass::coordinator
