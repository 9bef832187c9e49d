#include <algorithm>
#include <string>

#include "coordinator/charts/plot.hpp"
#include "core/error.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

constexpr double label_width = 170.0;
constexpr double lane_height = 16.0;
constexpr std::size_t label_columns_max = 24;

void draw_bars(const TimelineLane& lane, const AxisMap& x, double top, SvgWriter& writer) {
  constexpr double width_min = 1.0;
  for (const TimelineBar& bar : lane.bars) {
    if (!(bar.end >= x.range.from) || !(bar.begin <= x.range.to)) continue;
    const double begin = std::clamp(x.at(bar.begin), x.begin, x.end);
    const double end = std::clamp(x.at(bar.end), x.begin, x.end);
    writer.begin_group(bar.tooltip);
    writer.rectangle({begin, top + 3.0, std::max(width_min, end - begin), lane_height - 6.0},
                     writer.colour(Ink::first));
    writer.end_group();
  }
}

void draw_marks(const TimelineLane& lane, const AxisMap& x, double top, SvgWriter& writer) {
  for (const TimelineMark& mark : lane.marks) {
    if (!x.contains(mark.time)) continue;
    writer.begin_group(mark.tooltip);
    writer.line({x.at(mark.time), top + 1.0}, {x.at(mark.time), top + lane_height - 1.0},
                {.colour = writer.colour(Ink::second), .width = 2.0});
    writer.end_group();
  }
}

}  // namespace

double draw_chart(const Timeline& timeline, Point corner, double width, SvgWriter& writer) {
  constexpr std::size_t num_ticks_max = 8;
  PROOFMASS_EXPECT(timeline.x.scale == Scale::linear && timeline.x.from && timeline.x.to);
  const double height = draw_title(timeline.text.title, corner, width, writer);
  const Box box{corner.x + label_width, corner.y + height + 4.0, width - label_width - 12.0,
                lane_height * static_cast<double>(timeline.lanes.size())};
  const AxisMap x{.scale = timeline.x.scale,
                  .range = range_of(timeline.x, timeline.x.from, timeline.x.to, num_ticks_max),
                  .begin = box.left,
                  .end = box.right()};
  draw_x_axis(x, timeline.x, box, writer);
  for (std::size_t i = 0; i < timeline.lanes.size(); ++i) {
    const TimelineLane& lane = timeline.lanes[i];
    const double top = box.top + lane_height * static_cast<double>(i);
    writer.text({corner.x, top + lane_height - 4.0},
                wire::shortened(lane.label, label_columns_max));
    draw_bars(lane, x, top, writer);
    draw_marks(lane, x, top, writer);
  }
  return box.bottom() + x_axis_height - corner.y;
}

}  // namespace proofmass::coordinator
