#include "coordinator/cli/client_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <vector>

#include "coordinator/cli/progress_display.hpp"
#include "coordinator/report/status_json.hpp"
#include "coordinator/report/status_notes.hpp"
#include "coordinator/report/text_cells.hpp"
#include "proto/text/visible_text.hpp"
#include "proto/wire/names.hpp"

namespace proofmass::coordinator {
namespace {

using wire::CampaignPhase;
using wire::CampaignStatus;
using wire::WorkerStatus;

constexpr std::size_t table_width = 79;

constexpr std::array<TextColumn, 8> status_columns{{{"campaign", 17, true},
                                                    {"phase", 10, true},
                                                    {"prio", 5},
                                                    {"done", 11},
                                                    {"runs", 11},
                                                    {"%", 5},
                                                    {"runs/s", 8},
                                                    {"time left", 12}}};

constexpr std::array<TextColumn, 8> worker_columns{{{"id", 8},
                                                    {"  worker", 17, true},
                                                    {"host", 14, true},
                                                    {"pid", 8},
                                                    {"slots", 6},
                                                    {"lent", 8},
                                                    {"results", 9},
                                                    {"heard", 9}}};

std::uint64_t percent_done(const CampaignStatus& campaign) {
  return campaign.num_done * 100 / std::max<std::uint64_t>(1, campaign.num_runs);
}

std::string time_left(const CampaignStatus& campaign) {
  const bool is_known = campaign.remaining_s && !is_over(campaign);
  return is_known ? duration_text(*campaign.remaining_s) : "-";
}

std::string rate(const CampaignStatus& campaign) {
  return campaign.rate_hz > 0.0 ? measured_figure(campaign.rate_hz) : "-";
}

/// A row for each thing, below the titles.
template <typename Thing, typename CellsOf>
std::string table_of(std::span<const TextColumn> columns, const std::vector<Thing>& things,
                     const CellsOf& cells_of, std::size_t line_width_max) {
  std::vector<std::vector<std::string>> rows;
  for (const Thing& thing : things) rows.push_back(cells_of(thing));
  const std::vector<TextColumn> wide = widened(columns, rows, line_width_max);
  std::string text = table_heading(wide);
  for (const auto& cells : rows) text += table_row(wide, cells);
  return text;
}

std::vector<std::string> campaign_cells(const CampaignStatus& campaign) {
  return {campaign.name,
          std::string(wire::phase_name(campaign)),
          std::to_string(campaign.priority),
          std::to_string(campaign.num_done),
          std::to_string(campaign.num_runs),
          std::to_string(percent_done(campaign)),
          rate(campaign),
          time_left(campaign)};
}

std::string service_lines(const wire::StatusReply& status, std::size_t line_width_max) {
  std::uint64_t num_lent = 0;
  for (const CampaignStatus& campaign : status.campaigns) num_lent += campaign.num_lent;
  const std::size_t width = std::max(table_width, line_width_max);
  const std::string service = fmt::format("Proofmass {}, model {}, up {}", status.version,
                                          status.model_version, duration_text(status.uptime_s));
  const std::string workers =
      fmt::format("{} with {}, {} lent", counted(status.num_workers, "worker"),
                  counted(status.num_slots, "slot"), counted(num_lent, "run"));
  return fmt::format("{}\n{}\n\n", shortened(service, width), shortened(workers, width));
}

/// Seven characters at most.
std::string count_cell(std::uint64_t count) {
  constexpr std::uint64_t digits_max = 10'000'000;
  return count < digits_max ? std::to_string(count) : measured_figure(static_cast<double>(count));
}

/// In the largest unit: `3 s`, `12 min`, `3 h`, `4 d`.
std::string ago(double seconds) {
  constexpr double longest_s = 9999.0 * 86400.0;
  const auto total = static_cast<std::uint64_t>(std::clamp(seconds, 0.0, longest_s));
  if (total < 60) return fmt::format("{} s", total);
  if (total < 3600) return fmt::format("{} min", total / 60);
  if (total < 86400) return fmt::format("{} h", total / 3600);
  return fmt::format("{} d", total / 86400);
}

std::vector<std::string> worker_cells(const WorkerStatus& worker) {
  return {count_cell(worker.id.value),    "  " + worker.name,           worker.host,
          count_cell(worker.process_id),  count_cell(worker.num_slots), count_cell(worker.num_lent),
          count_cell(worker.num_results), ago(worker.silent_s)};
}

std::string further(std::uint64_t count, std::size_t num_shown, std::string_view thing) {
  const std::string note = further_note(count, num_shown, thing);
  return note.empty() ? note : note + "\n";
}

std::string lines_of(const std::vector<std::string>& notes) {
  std::string text;
  for (const std::string& note : notes) text += note + "\n";
  return text;
}

}  // namespace

bool is_over(const CampaignStatus& campaign) {
  return campaign.phase == CampaignPhase::finished || campaign.phase == CampaignPhase::cancelled;
}

std::string status_table(const wire::StatusReply& status, std::size_t line_width_max) {
  std::string text = service_lines(status, line_width_max);
  const std::string notes = lines_of(service_notes(status));
  if (status.campaigns.empty()) return text + "no campaigns\n" + notes;
  text += table_of(status_columns, status.campaigns, campaign_cells, line_width_max);
  for (const CampaignStatus& campaign : status.campaigns) {
    for (const std::string& note : notes_about(campaign)) {
      text += fmt::format("{}: {}\n", campaign.name, note);
    }
  }
  text += further(status.num_campaigns, status.campaigns.size(), "more campaign");
  return text + notes;
}

std::string workers_table(const wire::WorkersReply& workers, std::size_t line_width_max) {
  if (workers.workers.empty()) return "no workers\n";
  std::string text = table_of(worker_columns, workers.workers, worker_cells, line_width_max);
  for (const WorkerStatus& worker : workers.workers) {
    if (!worker.is_quarantined) continue;
    text += fmt::format("{}: in quarantine, is lent nothing: too many crashes on {}\n",
                        worker.id.value, worker.host);
  }
  text += further(workers.num_workers, workers.workers.size(), "more worker");
  return text;
}

std::string campaign_line(const CampaignStatus& campaign) {
  std::string text =
      fmt::format("{} {}: {} of {}, {} %", campaign.name, wire::phase_name(campaign),
                  campaign.num_done, counted(campaign.num_runs, "run"), percent_done(campaign));
  if (!is_over(campaign)) {
    if (campaign.rate_hz > 0.0) text += fmt::format(", {} runs/s", rate(campaign));
    if (campaign.remaining_s) text += fmt::format(", {} left", time_left(campaign));
  }
  for (const std::string& note : notes_about(campaign)) text += "; " + note;
  return text;
}

std::string done_json(std::string_view action, std::string_view campaign,
                      const wire::DoneReply& done) {
  return dumped({{"action", action}, {"campaign", campaign}, {"text", done.text}},
                JsonLayout::indented);
}

std::string released_json(std::string_view host, const wire::DoneReply& done) {
  return dumped({{"action", "release"}, {"host", host}, {"text", done.text}}, JsonLayout::indented);
}

}  // namespace proofmass::coordinator
