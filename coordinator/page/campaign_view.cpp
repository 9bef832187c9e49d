#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <map>
#include <set>
#include <utility>

#include "coordinator/charts/chart.hpp"
#include "coordinator/page/page_views.hpp"
#include "coordinator/report/status_notes.hpp"
#include "coordinator/table/table.hpp"
#include "proto/text/visible_text.hpp"
#include "proto/wire/names.hpp"

namespace proofmass::coordinator {
namespace {

using wire::markup_text;

/// Events that the page shows, page by page; the database and the API have more.
constexpr std::size_t shown_events_max = 200;

std::string facts_of(const CampaignRecord& campaign) {
  const proto::CampaignStatus& status = campaign.status;
  std::string html =
      "<dl>" + fact("phase", wire::phase_name(status)) + fact("done", grouped(status.num_done())) +
      fact("of runs", grouped(status.num_runs())) + fact("runs/s", rate_text(status)) +
      fact("time left", time_left_text(status)) + fact("lent", grouped(status.num_lent())) +
      fact("to be stored", grouped(campaign.num_waiting)) +
      fact("priority", std::to_string(status.priority()));
  if (!status.owner().empty()) html += fact("owner", markup_text(status.owner()));
  return html + "</dl>\n";
}

std::string results_of(const CampaignDetails& details, std::uint64_t num_done, TimePoint now) {
  if (details.html.empty()) return {};
  return fmt::format(
      "<section><h2>Results</h2>\n<p class=\"note\">{} of {} finished runs, read "
      "{} ago</p>\n{}</section>\n",
      grouped(details.num_runs), grouped(std::max(num_done, details.num_runs)),
      duration_text(seconds(now - details.read_at)), details.html);
}

/// A table under a heading; nothing without rows.
std::string titled(std::string_view title, const Table& table) {
  if (table.rows.empty()) return {};
  return fmt::format("<h3>{}</h3>\n{}", title, html_table(table));
}

std::string ends_table(const CampaignDetails& details) {
  Table table{.caption = "Finished runs without an estimate",
              .columns = {{"status", true}, {"cause", true}, {"session", true}, {"runs"}}};
  for (const EndCount& end : details.ends) {
    table.rows.push_back({end.status, end.cause, end.session, grouped(end.num_runs)});
  }
  return titled(table.caption, table);
}

std::string given_up_table(const CampaignDetails& details, std::uint64_t num_given_up) {
  Table table{.caption = "Runs that were given up",
              .columns = {{"run"}, {"reason", true}, {"attempts"}, {"given up", true}}};
  for (const GivenUpRecord& run : details.given_up) {
    table.rows.push_back(
        {std::to_string(run.run.value), run.reason, grouped(run.num_attempts), run.given_up_utc});
  }
  if (num_given_up > table.rows.size()) {
    table.notes.push_back(
        fmt::format("showing the first {} of {}", table.rows.size(), grouped(num_given_up)));
  }
  return titled(table.caption, table);
}

std::string losses_table(const CampaignDetails& details) {
  Table table{.caption = "Attempts without a result",
              .columns = {{"reason", true}, {"losses"}, {"runs"}, {"counted against runs"}}};
  for (const LossCount& loss : details.losses) {
    table.rows.push_back(
        {loss.reason, grouped(loss.num_losses), grouped(loss.num_runs), grouped(loss.num_blamed)});
  }
  return titled("Attempts without a result", table);
}

std::string failures_of(const CampaignDetails& details, std::uint64_t num_given_up) {
  const std::string tables =
      ends_table(details) + given_up_table(details, num_given_up) + losses_table(details);
  return "<section><h2>Failures</h2>\n" +
         (tables.empty() ? "<p class=\"note\">none</p>\n" : tables) + "</section>\n";
}

std::string attempts_of(const RecentAttempts& attempts) {
  std::string html = "<section><h2>Attempts</h2>\n" + attempts_chart(attempts) +
                     "<p class=\"note\">A bar is the time that runs of one batch took; a line is a "
                     "loss.";
  if (attempts.num_runs_left_out > 0) {
    html += fmt::format(" {} older runs are left out.", grouped(attempts.num_runs_left_out));
  }
  return html + "</p></section>\n";
}

std::string events_of(const std::deque<StoredEvent>& events, const std::string& name,
                      std::size_t page) {
  const std::size_t count = std::min(events.size(), shown_events_max);
  const PageOfList list = page_of_list(page, count);
  Table table{.caption = "Events", .columns = {{"time", true}, {"event", true}, {"details", true}}};
  for (std::size_t i = list.first; i < list.end; ++i) {
    const StoredEvent& event = events[events.size() - 1 - i];
    Cell details(event.text);
    details.markup = "<span class=\"long\">" + markup_text(event.text) + "</span>";
    Cell time(event.time_utc);
    time.markup = "<time>" + markup_text(event.time_utc) + "</time>";
    table.rows.push_back({std::move(time), event.kind, std::move(details)});
  }
  std::string html = "<section><h2>Events</h2>\n" + table_or_nothing(table);
  html += list_navigation(list, "events, the newest first", percent_encoded(name) + "?events=");
  if (events.size() > count) {
    html += fmt::format(
        "<p class=\"note\">{} older events are in the table <code>event</code> of the "
        "database</p>\n",
        grouped(events.size() - count));
  }
  return html + "</section>\n";
}

std::string text_of(const CampaignDetails* details, const CampaignRecord& campaign,
                    const PageRequest& request, TimePoint now) {
  if (details == nullptr) return "<p class=\"note\">The database is being read.</p>\n";
  std::string html;
  if (!details->failure.empty()) {
    html = notes_list({{"the database cannot be read now: " + details->failure}});
  }
  const proto::CampaignStatus& status = campaign.status;
  return html + results_of(*details, status.num_done(), now) +
         failures_of(*details, status.num_given_up()) + attempts_of(details->attempts) +
         events_of(details->events, status.name(), request.number("events").value_or(1));
}

}  // namespace

PageContent campaign_page(const CampaignRecord& campaign, const CampaignDetails* details,
                          const PageRequest& request, TimePoint now) {
  const proto::CampaignStatus& status = campaign.status;
  return {.title = "Campaign " + status.name(),
          .to_root = "../",
          .live = fmt::format("<p class=\"large\">{}</p>\n", progress_bar(status, "progress")) +
                  facts_of(campaign) + notes_list(notes_about(status)) +
                  text_of(details, campaign, request, now)};
}

namespace {

constexpr double chart_span_s = 1800.0;
constexpr std::size_t chart_lanes_max = 24;

double end_of(const RecentAttempt& attempt) { return static_cast<double>(attempt.unix_s); }
double begin_of(const RecentAttempt& attempt) { return end_of(attempt) - attempt.compute_s; }

/// `run 17`, `16 runs, 32 to 47`; of lost ones, which are all in a row, `runs 32 to 47`.
std::string runs_text(const RecentAttempt& of) {
  if (of.num_runs == 1) return fmt::format("run {}", of.first.value);
  return fmt::format("{} {} to {}",
                     of.reason.empty() ? fmt::format("{} runs,", of.num_runs) : "runs",
                     of.first.value, of.last.value);
}

/// The part of time that the chart shows, seconds since 1970: from the first attempt to the last
/// one, at most chart_span_s.
std::pair<double, double> shown_time(const RecentAttempts& attempts) {
  double begin_s = 1e300, end_s = 0.0;
  for (const auto* const some : {&attempts.computed, &attempts.lost}) {
    for (const RecentAttempt& attempt : *some) {
      begin_s = std::min(begin_s, begin_of(attempt));
      end_s = std::max(end_s, end_of(attempt));
    }
  }
  begin_s = std::max(begin_s, end_s - chart_span_s);
  return {std::min(begin_s, end_s - 1.0), end_s};
}

}  // namespace

std::vector<TimelineLane> lanes_of(const RecentAttempts& attempts, double last_s) {
  // Backwards in time: a lane is free for what ends before its earliest attempt begins, or could
  // have, as far as the second is known.
  constexpr double shift_s_max = 1.0;
  std::map<std::uint64_t, std::vector<TimelineLane>> lanes;
  const auto lanes_of_worker = [&](const RecentAttempt& of) -> std::vector<TimelineLane>& {
    std::vector<TimelineLane>& of_worker = lanes[of.worker_key];
    if (of_worker.empty()) of_worker.push_back({.label = of.worker});
    return of_worker;
  };
  for (const RecentAttempt& lost : attempts.lost) {
    const double time_s = end_of(lost) - last_s;
    lanes_of_worker(lost).front().marks.push_back(
        {.begin = time_s,
         .end = time_s,
         .tooltip = fmt::format("{} lost: {}", runs_text(lost), lost.reason)});
  }
  for (const RecentAttempt& computed : attempts.computed) {
    std::vector<TimelineLane>& of_worker = lanes_of_worker(computed);
    const double end_s = end_of(computed) - last_s;
    const auto free_until = [&](const TimelineLane& lane) {
      return lane.bars.empty() ? end_s : std::min(end_s, lane.bars.back().begin);
    };
    auto lane = std::ranges::find_if(of_worker, [&](const TimelineLane& candidate) {
      return free_until(candidate) >= end_s - shift_s_max;
    });
    if (lane == of_worker.end()) lane = of_worker.insert(lane, TimelineLane());
    const double placed_end_s = free_until(*lane);
    lane->bars.push_back({.begin = placed_end_s - computed.compute_s,
                          .end = placed_end_s,
                          .tooltip = fmt::format("{}, {:.3g} s, attempt {}", runs_text(computed),
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
  const auto [begin_s, end_s] = shown_time(attempts);
  const double span_s = end_s - begin_s;
  std::set<std::uint64_t> workers;
  for (const auto* const some : {&attempts.computed, &attempts.lost}) {
    for (const RecentAttempt& attempt : *some) workers.insert(attempt.worker_key);
  }
  std::vector<TimelineLane> lanes = lanes_of(attempts, end_s);
  // Lanes end with the span of the chart: others have nothing to show.
  std::erase_if(lanes, [&](const TimelineLane& lane) {
    return lane.label.empty() && lane.bars.front().end < -span_s;
  });
  const std::size_t num_lanes = lanes.size();
  lanes.resize(std::min(num_lanes, chart_lanes_max));
  Timeline timeline{
      .text = {.id = "attempts",
               .title = "Attempts by worker",
               .description = fmt::format("Batches: {}, losses: {}, workers: {}, within {:.0f} s.",
                                          attempts.computed.size(), attempts.lost.size(),
                                          workers.size(), span_s)},
      .x = {.label = "time until the last result, s", .from = -span_s, .to = 0.0},
      .lanes = std::move(lanes)};
  std::string html = fmt::format(
      "<div class=\"scroll\" tabindex=\"0\" role=\"region\" "
      "aria-label=\"Timeline of attempts\">{}</div>\n",
      svg_of(timeline, SvgUse::embedded));
  if (num_lanes > chart_lanes_max) {
    html +=
        fmt::format("<p class=\"note\">showing {} of {} lanes</p>\n", chart_lanes_max, num_lanes);
  }
  return html;
}

}  // namespace proofmass::coordinator
