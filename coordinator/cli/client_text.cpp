#include "coordinator/cli/client_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "coordinator/cli/progress_display.hpp"
#include "coordinator/report/status_notes.hpp"
#include "coordinator/table/figures.hpp"
#include "proto/text/visible_text.hpp"
#include "proto/wire/names.hpp"

namespace proofmass::coordinator {
namespace {

using proto::CampaignStatus;

std::string time_left(const CampaignStatus& campaign) {
  const bool is_known = campaign.has_remaining_s() && !is_over(campaign);
  return is_known ? duration_text(campaign.remaining_s()) : "-";
}

std::string rate(const CampaignStatus& campaign) {
  return campaign.rate_hz() > 0.0 ? measured_figure(campaign.rate_hz()) : "-";
}

void add_further(std::uint64_t count, int num_shown, std::string_view thing,
                 std::vector<Remark>& remarks) {
  const std::string note = further_note(count, num_shown, thing);
  if (!note.empty()) remarks.push_back({note});
}

Table campaigns_table(const proto::StatusReply& status) {
  Table table;
  if (status.campaigns().empty()) table.remarks.push_back({"no campaigns"});
  if (!status.campaigns().empty()) {
    table.columns = {{"campaign", true, 17}, {"phase", true, 10},     {"prio", false, 5},
                     {"done", false, 11},    {"runs", false, 11},     {"%", false, 5},
                     {"runs/s", false, 8},   {"time left", false, 12}};
  }
  for (const CampaignStatus& campaign : status.campaigns()) {
    table.rows.push_back(
        {campaign.name(), wire::phase_name(campaign), std::to_string(campaign.priority()),
         std::to_string(campaign.num_done()), std::to_string(campaign.num_runs()),
         std::to_string(percent_done(campaign)), rate(campaign), time_left(campaign)});
    for (Remark note : notes_about(campaign)) {
      note.text = fmt::format("{}: {}", campaign.name(), note.text);
      table.remarks.push_back(std::move(note));
    }
  }
  add_further(status.num_campaigns(), status.campaigns_size(), "more campaign", table.remarks);
  for (Remark& note : service_notes(status)) table.remarks.push_back(std::move(note));
  return table;
}

std::string service_lines(const proto::StatusReply& status, std::size_t line_width_max) {
  std::uint64_t num_lent = 0;
  std::set<std::string> versions;
  for (const CampaignStatus& campaign : status.campaigns()) {
    num_lent += campaign.num_lent();
    versions.insert(campaign.model_version());
  }
  const std::size_t width = line_width_max;
  const std::string service = fmt::format("Proofmass {}, {}, up {}", status.version(),
                                          models_text(std::move(versions), status.model_version()),
                                          duration_text(status.uptime_s()));
  const std::string workers =
      fmt::format("{} with {}, {} lent", counted(status.num_workers(), "worker"),
                  counted(status.num_slots(), "slot"), counted(num_lent, "run"));
  return fmt::format("{}\n{}\n\n", shortened(wire::visible_text(service), width),
                     shortened(workers, width));
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

}  // namespace

bool is_over(const CampaignStatus& campaign) {
  return campaign.phase() == proto::CAMPAIGN_PHASE_FINISHED ||
         campaign.phase() == proto::CAMPAIGN_PHASE_CANCELLED;
}

std::string status_text(const proto::StatusReply& status, const TerminalStyle& style) {
  return service_lines(status, style.line_width_max) +
         terminal_text(campaigns_table(status), style);
}

namespace {

/// `7: 1 NVIDIA H100 80GB HBM3 (CUDA 13.0), 2050 runs/s`.
std::string cards_line(const proto::WorkerStatus& worker) {
  std::string line = fmt::format("{}: {}", worker.worker_id(), worker.cards());
  if (worker.card_rate_hz() > 0.0)
    line += fmt::format(", {} runs/s", measured_figure(worker.card_rate_hz()));
  return line;
}

}  // namespace

Table workers_table(const proto::WorkersReply& workers) {
  if (workers.workers().empty()) return {.remarks = {{"no workers"}}};
  Table table{.columns = {{"id", false, 8},
                          {"  worker", true, 17},
                          {"host", true, 14},
                          {"pid", false, 8},
                          {"slots", false, 6},
                          {"lent", false, 8},
                          {"results", false, 9},
                          {"heard", false, 9}}};
  for (const proto::WorkerStatus& worker : workers.workers()) {
    table.rows.push_back({count_cell(worker.worker_id()), "  " + worker.name(), worker.host(),
                          count_cell(worker.process_id()), count_cell(worker.num_slots()),
                          count_cell(worker.num_lent()), count_cell(worker.num_results()),
                          ago(worker.silent_s())});
    if (!worker.cards().empty()) table.remarks.push_back({cards_line(worker)});
    if (!worker.is_quarantined()) continue;
    table.remarks.push_back(
        {fmt::format("{}: in quarantine, is lent nothing: too many crashes on {}",
                     worker.worker_id(), worker.host()),
         Tone::bad});
  }
  add_further(workers.num_workers(), workers.workers_size(), "more worker", table.remarks);
  return table;
}

std::string campaign_line(const CampaignStatus& campaign) {
  std::string text =
      fmt::format("{} {}: {} of {}, {} %", campaign.name(), wire::phase_name(campaign),
                  campaign.num_done(), counted(campaign.num_runs(), "run"), percent_done(campaign));
  if (!is_over(campaign)) {
    if (campaign.rate_hz() > 0.0) text += fmt::format(", {} runs/s", rate(campaign));
    if (campaign.has_remaining_s()) text += fmt::format(", {} left", time_left(campaign));
  }
  for (const Remark& note : notes_about(campaign)) text += "; " + note.text;
  return text;
}

std::string done_text(const proto::DoneReply& done, const ActionTaken& action,
                      OutputFormat format) {
  if (format == OutputFormat::text) return done.text() + "\n";
  return dumped(
      {{"action", action.name}, {std::string(action.kind), action.target}, {"text", done.text()}},
      JsonLayout::indented);
}

}  // namespace proofmass::coordinator
