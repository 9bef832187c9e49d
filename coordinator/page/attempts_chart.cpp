#include "coordinator/page/attempts_chart.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>

#include "coordinator/report/status_json.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

using TraceJson = nlohmann::ordered_json;
using wire::markup_text;

constexpr double chart_span_s = 1800.0;
constexpr std::size_t chart_lanes_max = 24;
constexpr double chart_width = 900.0;
constexpr double label_width = 170.0;
constexpr double lane_height = 16.0;
constexpr double axis_height = 22.0;

double end_of(const ComputedRuns& computed) {
  return static_cast<double>(computed.received_unix_s);
}
double begin_of(const ComputedRuns& computed) { return end_of(computed) - computed.compute_s; }

std::map<std::uint64_t, const WorkerRecord*> workers_by_key(const RecentAttempts& attempts) {
  std::map<std::uint64_t, const WorkerRecord*> workers;
  for (const WorkerRecord& worker : attempts.workers) workers[worker.key] = &worker;
  return workers;
}

std::string worker_name(const std::map<std::uint64_t, const WorkerRecord*>& workers,
                        std::uint64_t key) {
  const auto found = workers.find(key);
  return found == workers.end() ? fmt::format("worker {}", key) : found->second->name;
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

/// Seconds since 1970 to places of the chart.
struct TimeAxis {
  double begin_s;
  double end_s;

  [[nodiscard]] double x(double time_s) const {
    const double fraction = (std::clamp(time_s, begin_s, end_s) - begin_s) / (end_s - begin_s);
    return label_width + fraction * (chart_width - label_width);
  }
};

/// From the first attempt that is shown to the last one; at most chart_span_s.
TimeAxis axis_of(const RecentAttempts& attempts) {
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

std::string lane_bars(const AttemptLane& lane, const TimeAxis& axis, double y) {
  constexpr double width_min = 1.0;
  std::string svg;
  for (const PlacedAttempt& attempt : lane.attempts) {
    if (attempt.end_s < axis.begin_s) continue;
    const double x = axis.x(attempt.begin_s());
    svg += fmt::format(
        "<rect class=\"run\" x=\"{:.1f}\" y=\"{:.0f}\" width=\"{:.1f}\" height=\"{:.0f}\">"
        "<title>{}, {:.3g} s, attempt {}</title></rect>",
        x, y + 3.0, std::max(width_min, axis.x(attempt.end_s) - x), lane_height - 6.0,
        runs_text(attempt.computed->runs), attempt.computed->compute_s,
        attempt.computed->attempt.value);
  }
  return svg;
}

std::string loss_lines(const RecentAttempts& attempts, std::uint64_t worker_key,
                       const TimeAxis& axis, double y) {
  std::string svg;
  for (const LostAttempt& lost : attempts.lost) {
    const auto time_s = static_cast<double>(lost.lost_unix_s);
    if (lost.worker_key != worker_key || time_s < axis.begin_s) continue;
    const double x = axis.x(time_s);
    svg += fmt::format(
        "<line class=\"loss\" x1=\"{0:.1f}\" x2=\"{0:.1f}\" y1=\"{1:.0f}\" y2=\"{2:.0f}\"><title>"
        "{3} lost: {4}</title></line>",
        x, y + 1.0, y + lane_height - 1.0, runs_text(lost.runs), markup_text(lost.reason));
  }
  return svg;
}

std::string axis_lines(const TimeAxis& axis, double height) {
  constexpr int num_parts = 4;
  std::string svg;
  for (int i = 0; i <= num_parts; ++i) {
    const double time_s = axis.begin_s + (axis.end_s - axis.begin_s) * i / num_parts;
    const double x = axis.x(time_s);
    const std::string_view anchor = i == num_parts ? "end" : "middle";
    svg += fmt::format(
        "<line class=\"axis\" x1=\"{0:.1f}\" x2=\"{0:.1f}\" y1=\"0\" y2=\"{1:.0f}\"/>"
        "<text x=\"{0:.1f}\" y=\"{2:.0f}\" text-anchor=\"{3}\">{4}</text>",
        x, height, height + 15.0, anchor,
        i == num_parts ? "last" : fmt::format("−{:.3g} s", axis.end_s - time_s));
  }
  return svg;
}

// Lanes end with the span of the chart: others have nothing to show.
std::vector<AttemptLane> shown_lanes(const RecentAttempts& attempts, const TimeAxis& axis) {
  std::vector<AttemptLane> lanes = lanes_of(attempts);
  std::erase_if(lanes, [&](const AttemptLane& lane) {
    return lane.number > 0 && lane.attempts.front().end_s < axis.begin_s;
  });
  return lanes;
}

TraceJson metadata(std::string_view kind, std::uint64_t process, std::size_t thread,
                   const std::string& name) {
  return {
      {"name", kind}, {"ph", "M"}, {"pid", process}, {"tid", thread}, {"args", {{"name", name}}}};
}

TraceJson run_numbers(const std::vector<RunIndex>& runs) {
  TraceJson numbers = TraceJson::array();
  for (const RunIndex run : runs) numbers.push_back(run.value);
  return numbers;
}

void add_lane(const AttemptLane& lane, TraceJson& events) {
  constexpr double us_per_s = 1e6;
  events.push_back(metadata("thread_name", lane.worker_key, lane.number,
                            fmt::format("lane {}", lane.number + 1)));
  for (const PlacedAttempt& attempt : lane.attempts) {
    const ComputedRuns* const computed = attempt.computed;
    events.push_back({{"name", runs_text(computed->runs)},
                      {"cat", "computed"},
                      {"ph", "X"},
                      {"ts", attempt.begin_s() * us_per_s},
                      {"dur", computed->compute_s * us_per_s},
                      {"pid", lane.worker_key},
                      {"tid", lane.number},
                      {"args",
                       {{"runs", run_numbers(computed->runs)},
                        {"attempt", computed->attempt.value},
                        {"compute_s", computed->compute_s}}}});
  }
}

void add_loss(const LostAttempt& lost, TraceJson& events) {
  constexpr std::uint64_t us_per_s = 1'000'000;
  events.push_back({{"name", fmt::format("{} lost: {}", runs_text(lost.runs), lost.reason)},
                    {"cat", "lost"},
                    {"ph", "i"},
                    {"s", "p"},
                    {"ts", lost.lost_unix_s * us_per_s},
                    {"pid", lost.worker_key},
                    {"tid", 0},
                    {"args",
                     {{"first_run", lost.runs.first.value},
                      {"num_runs", lost.runs.count},
                      {"attempt", lost.attempt.value},
                      {"reason", lost.reason}}}});
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
  const TimeAxis axis = axis_of(attempts);
  const std::vector<AttemptLane> lanes = shown_lanes(attempts, axis);
  const std::size_t num_shown = std::min(lanes.size(), chart_lanes_max);
  const auto workers = workers_by_key(attempts);
  const double height = static_cast<double>(num_shown) * lane_height;
  std::string svg = fmt::format(
      "<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"Timeline of attempts\">"
      "<svg class=\"attempts\" viewBox=\"0 0 {0:.0f} {1:.0f}\" width=\"{0:.0f}\" "
      "height=\"{1:.0f}\" role=\"img\" "
      "aria-label=\"batches: {2}, losses: {3}, workers: {4}, seconds: {5:.0f}\">",
      chart_width, height + axis_height, attempts.computed.size(), attempts.lost.size(),
      attempts.workers.size(), axis.end_s - axis.begin_s);
  svg += axis_lines(axis, height);
  for (std::size_t i = 0; i < num_shown; ++i) {
    const double y = static_cast<double>(i) * lane_height;
    if (lanes[i].number == 0) {
      svg +=
          fmt::format("<text x=\"0\" y=\"{:.0f}\">{}</text>", y + lane_height - 4.0,
                      markup_text(wire::shortened(worker_name(workers, lanes[i].worker_key), 24)));
      svg += loss_lines(attempts, lanes[i].worker_key, axis, y);
    }
    svg += lane_bars(lanes[i], axis, y);
  }
  svg += "</svg></div>\n";
  if (num_shown < lanes.size()) {
    svg += fmt::format("<p class=\"note\">showing {} of {} lanes; the trace has all</p>\n",
                       num_shown, lanes.size());
  }
  return svg;
}

std::string attempts_trace(const RecentAttempts& attempts, std::string_view campaign) {
  TraceJson events = TraceJson::array();
  for (const WorkerRecord& worker : attempts.workers) {
    events.push_back(
        metadata("process_name", worker.key, 0, fmt::format("{} on {}", worker.name, worker.host)));
  }
  for (const AttemptLane& lane : lanes_of(attempts)) add_lane(lane, events);
  for (const LostAttempt& lost : attempts.lost) add_loss(lost, events);
  const TraceJson trace{{"traceEvents", std::move(events)},
                        {"displayTimeUnit", "ms"},
                        {"otherData",
                         {{"api_version", 1},
                          {"campaign", campaign},
                          {"num_runs_left_out", attempts.num_runs_left_out},
                          {"num_losses_left_out", attempts.num_losses_left_out}}}};
  return dumped(trace, JsonLayout::one_line);
}

}  // namespace proofmass::coordinator
