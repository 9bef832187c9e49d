#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <map>
#include <utility>

#include "coordinator/charts/svg.hpp"
#include "coordinator/page/page_views.hpp"

namespace proofmass::coordinator {
namespace {

constexpr double chart_span_s = 1800.0;
constexpr std::size_t chart_lanes_max = 24;

double end_of(const ComputedRuns& computed) {
  return static_cast<double>(computed.received_unix_s);
}
double begin_of(const ComputedRuns& computed) { return end_of(computed) - computed.compute_s; }

std::string worker_name(const RecentAttempts& attempts, std::uint64_t key) {
  const auto found = std::ranges::find(attempts.workers, key, &WorkerRecord::key);
  return found == attempts.workers.end() ? fmt::format("worker {}", key) : found->name;
}

/// `run 17`, `16 runs, 32 to 47`.
std::string runs_text(const std::vector<RunIndex>& runs) {
  if (runs.size() == 1) return fmt::format("run {}", runs.front().value);
  return fmt::format("{} runs, {} to {}", runs.size(), runs.front().value, runs.back().value);
}

std::string runs_text(const RunRange& runs) {
  if (runs.count == 1) return fmt::format("run {}", runs.first.value);
  return fmt::format("runs {} to {}", runs.first.value, runs.end() - 1);
}

/// The part of time that the chart shows, seconds since 1970: from the first attempt to the last
/// one, at most chart_span_s.
struct ShownTime {
  double begin_s;
  double end_s;
};

ShownTime shown_time(const RecentAttempts& attempts) {
  double begin_s = 1e300, end_s = 0.0;
  for (const ComputedRuns& computed : attempts.computed) {
    begin_s = std::min(begin_s, begin_of(computed));
    end_s = std::max(end_s, end_of(computed));
  }
  for (const LostAttempt& lost : attempts.lost) {
    begin_s = std::min(begin_s, static_cast<double>(lost.lost_unix_s));
    end_s = std::max(end_s, static_cast<double>(lost.lost_unix_s));
  }
  begin_s = std::max(begin_s, end_s - chart_span_s);
  return {.begin_s = std::min(begin_s, end_s - 1.0), .end_s = end_s};
}

}  // namespace

std::vector<TimelineLane> lanes_of(const RecentAttempts& attempts, double last_s) {
  // Backwards in time: a lane is free for what ends before its earliest attempt begins, or could
  // have, as far as the second is known.
  constexpr double shift_s_max = 1.0;
  std::map<std::uint64_t, std::vector<TimelineLane>> lanes;
  const auto lanes_of_worker = [&](std::uint64_t key) -> std::vector<TimelineLane>& {
    std::vector<TimelineLane>& of_worker = lanes[key];
    if (of_worker.empty()) of_worker.push_back({.label = worker_name(attempts, key)});
    return of_worker;
  };
  for (const LostAttempt& lost : attempts.lost) {
    lanes_of_worker(lost.worker_key)
        .front()
        .marks.push_back(
            {.time = static_cast<double>(lost.lost_unix_s) - last_s,
             .tooltip = fmt::format("{} lost: {}", runs_text(lost.runs), lost.reason)});
  }
  for (const ComputedRuns& computed : attempts.computed) {
    std::vector<TimelineLane>& of_worker = lanes_of_worker(computed.worker_key);
    const double end_s = end_of(computed) - last_s;
    const auto free_until = [&](const TimelineLane& lane) {
      return lane.bars.empty() ? end_s : std::min(end_s, lane.bars.back().begin);
    };
    auto lane = std::ranges::find_if(of_worker, [&](const TimelineLane& candidate) {
      return free_until(candidate) >= end_s - shift_s_max;
    });
    if (lane == of_worker.end()) lane = of_worker.insert(lane, TimelineLane());
    const double placed_end_s = free_until(*lane);
    lane->bars.push_back(
        {.begin = placed_end_s - computed.compute_s,
         .end = placed_end_s,
         .tooltip = fmt::format("{}, {:.3g} s, attempt {}", runs_text(computed.runs),
                                computed.compute_s, computed.attempt.value)});
  }
  std::vector<TimelineLane> all;
  for (auto& [key, of_worker] : lanes) std::ranges::move(of_worker, std::back_inserter(all));
  return all;
}

std::string attempts_chart(const RecentAttempts& attempts) {
  if (attempts.computed.empty() && attempts.lost.empty()) {
    return "<p class=\"note\">none yet</p>\n";
  }
  const ShownTime shown = shown_time(attempts);
  std::vector<TimelineLane> lanes = lanes_of(attempts, shown.end_s);
  // Lanes end with the span of the chart: others have nothing to show.
  std::erase_if(lanes, [&](const TimelineLane& lane) {
    return lane.label.empty() && lane.bars.front().end < shown.begin_s - shown.end_s;
  });
  const std::size_t num_lanes = lanes.size();
  lanes.resize(std::min(num_lanes, chart_lanes_max));
  Timeline timeline{
      .text = {.id = "attempts",
               .title = "Attempts by worker",
               .description = fmt::format("Batches: {}, losses: {}, workers: {}, within {:.0f} s.",
                                          attempts.computed.size(), attempts.lost.size(),
                                          attempts.workers.size(), shown.end_s - shown.begin_s)},
      .x = {.label = "time until the last result, s",
            .from = shown.begin_s - shown.end_s,
            .to = 0.0},
      .lanes = std::move(lanes)};
  std::string html = fmt::format(
      "<div class=\"scroll attempts\" tabindex=\"0\" role=\"region\" "
      "aria-label=\"Timeline of attempts\">{}</div>\n",
      svg_of(timeline, SvgUse::embedded));
  if (num_lanes > chart_lanes_max) {
    html +=
        fmt::format("<p class=\"note\">showing {} of {} lanes</p>\n", chart_lanes_max, num_lanes);
  }
  return html;
}

}  // namespace proofmass::coordinator
