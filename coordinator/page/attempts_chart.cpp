#include "coordinator/page/attempts_chart.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <span>

#include "coordinator/charts/svg.hpp"

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

std::vector<TimelineBar> bars_of(const AttemptLane& lane, double last_s) {
  std::vector<TimelineBar> bars;
  for (const PlacedAttempt& attempt : lane.attempts) {
    bars.push_back(
        {.begin = attempt.begin_s() - last_s,
         .end = attempt.end_s - last_s,
         .tooltip = fmt::format("{}, {:.3g} s, attempt {}", runs_text(attempt.computed->runs),
                                attempt.computed->compute_s, attempt.computed->attempt.value)});
  }
  return bars;
}

std::vector<TimelineMark> losses_of(const RecentAttempts& attempts, std::uint64_t worker_key,
                                    double last_s) {
  std::vector<TimelineMark> marks;
  for (const LostAttempt& lost : attempts.lost) {
    if (lost.worker_key != worker_key) continue;
    marks.push_back({.time = static_cast<double>(lost.lost_unix_s) - last_s,
                     .tooltip = fmt::format("{} lost: {}", runs_text(lost.runs), lost.reason)});
  }
  return marks;
}

// Lanes end with the span of the chart: others have nothing to show.
std::vector<AttemptLane> shown_lanes(const RecentAttempts& attempts, const ShownTime& shown) {
  std::vector<AttemptLane> lanes = lanes_of(attempts);
  std::erase_if(lanes, [&](const AttemptLane& lane) {
    return lane.number > 0 && lane.attempts.front().end_s < shown.begin_s;
  });
  return lanes;
}

}  // namespace

std::vector<AttemptLane> lanes_of(const RecentAttempts& attempts) {
  // Backwards in time: a lane is free for what ends before its earliest attempt begins, or could
  // have, as far as the second is known.
  constexpr double shift_s_max = 1.0;
  std::map<std::uint64_t, std::vector<AttemptLane>> lanes;
  for (const LostAttempt& lost : attempts.lost) {
    auto& of_worker = lanes[lost.worker_key];
    if (of_worker.empty()) of_worker.push_back({.worker_key = lost.worker_key, .attempts = {}});
  }
  for (const ComputedRuns& computed : attempts.computed) {
    auto& of_worker = lanes[computed.worker_key];
    const double end_s = end_of(computed);
    const auto free_until = [&](const AttemptLane& lane) {
      return lane.attempts.empty() ? end_s : std::min(end_s, lane.attempts.back().begin_s());
    };
    auto lane = std::ranges::find_if(of_worker, [&](const AttemptLane& candidate) {
      return free_until(candidate) >= end_s - shift_s_max;
    });
    if (lane == of_worker.end()) {
      of_worker.push_back(
          {.worker_key = computed.worker_key, .number = of_worker.size(), .attempts = {}});
      lane = std::prev(of_worker.end());
    }
    lane->attempts.push_back({.computed = &computed, .end_s = free_until(*lane)});
  }
  std::vector<AttemptLane> all;
  for (auto& [key, of_worker] : lanes) std::ranges::move(of_worker, std::back_inserter(all));
  return all;
}

std::string attempts_chart(const RecentAttempts& attempts) {
  if (attempts.computed.empty() && attempts.lost.empty()) {
    return "<p class=\"note\">none yet</p>\n";
  }
  const ShownTime shown = shown_time(attempts);
  const std::vector<AttemptLane> lanes = shown_lanes(attempts, shown);
  const std::size_t num_shown = std::min(lanes.size(), chart_lanes_max);
  Timeline timeline{
      .text = {.id = "attempts",
               .title = "Attempts by worker",
               .description = fmt::format("Batches: {}, losses: {}, workers: {}, within {:.0f} s.",
                                          attempts.computed.size(), attempts.lost.size(),
                                          attempts.workers.size(), shown.end_s - shown.begin_s)},
      .x = {.label = "time until the last result, s",
            .from = shown.begin_s - shown.end_s,
            .to = 0.0}};
  for (const AttemptLane& lane : std::span(lanes).first(num_shown)) {
    TimelineLane& drawn = timeline.lanes.emplace_back();
    drawn.bars = bars_of(lane, shown.end_s);
    if (lane.number > 0) continue;
    drawn.label = worker_name(attempts, lane.worker_key);
    drawn.marks = losses_of(attempts, lane.worker_key, shown.end_s);
  }
  std::string html = fmt::format(
      "<div class=\"scroll attempts\" tabindex=\"0\" role=\"region\" "
      "aria-label=\"Timeline of attempts\">{}</div>\n",
      svg_of(timeline, SvgUse::embedded));
  if (num_shown < lanes.size()) {
    html += fmt::format("<p class=\"note\">showing {} of {} lanes</p>\n", num_shown, lanes.size());
  }
  return html;
}

}  // namespace proofmass::coordinator
