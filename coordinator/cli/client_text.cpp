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

std::string counted(std::uint64_t count, std::string_view thing) {
  return fmt::format("{} {}{}", count, thing, count == 1 ? "" : "s");
}

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

std::string comparison_note(const CampaignStatus& campaign) {
  const std::string compared =
      counted(campaign.num_audited, "result") + " compared with a second computation: ";
  if (campaign.num_mismatches == 0) return compared + "all equal";
  return compared + fmt::format("{} differ (none may)", campaign.num_mismatches);
}

/// What is out of the ordinary about a campaign.
std::vector<std::string> notes_about(const CampaignStatus& campaign) {
  std::vector<std::string> notes;
  if (!campaign.storage_failure.empty()) {
    notes.push_back("nothing can be stored: " + wire::visible_text(campaign.storage_failure));
  }
  if (campaign.num_given_up > 0) {
    notes.push_back(counted(campaign.num_given_up, "run") + " given up: too many workers crashed");
  }
  if (campaign.num_without_estimate > 0) {
    notes.push_back(counted(campaign.num_without_estimate, "run") + " without an estimate");
  }
  if (campaign.num_audited > 0 || campaign.num_mismatches > 0) {
    notes.push_back(comparison_note(campaign));
  }
  return notes;
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
          std::string(wire::name_of(campaign.phase)),
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
  if (count <= num_shown) return {};
  return fmt::format("and {}\n", counted(count - num_shown, thing));
}

std::string quarantine_note(const std::string& host) {
  return fmt::format(
      "host {0} is in quarantine: too many workers crashed there; `proofmass release {0}`\n", host);
}

std::string factory_note(const wire::FactoryStatus& factory) {
  const wire::FactoryReport& report = factory.report;
  std::string note =
      fmt::format("factory {} ({}) {}: {} wanted, {} registered, {} in the queue", report.name,
                  report.batch_system, wire::name_of(report.phase),
                  counted(report.num_wanted, "worker"), report.num_registered, report.num_queued);
  if (report.phase == wire::FactoryPhase::waiting) {
    const double left_s = std::max(0.0, report.wait_s - factory.silent_s);
    note += fmt::format("; tries again in {}", duration_text(left_s));
  }
  if (!report.reason.empty()) note += "; " + wire::visible_text(report.reason);
  return note + "\n";
}

/// What concerns the coordinator, and no campaign that it serves.
std::string service_notes(const wire::StatusReply& status) {
  std::string text;
  for (const wire::UnservedFile& file : status.unserved_files) {
    text += fmt::format("not served, tried again: {}\n", wire::visible_text(file.reason));
  }
  text += further(status.num_unserved_files, status.unserved_files.size(), "more such file");
  for (const std::string& host : status.quarantined_hosts) text += quarantine_note(host);
  text += further(status.num_quarantined_hosts, status.quarantined_hosts.size(), "more such host");
  for (const wire::FactoryStatus& factory : status.factories) text += factory_note(factory);
  return text;
}

}  // namespace

bool is_over(const CampaignStatus& campaign) {
  return campaign.phase == CampaignPhase::finished || campaign.phase == CampaignPhase::cancelled;
}

std::string status_table(const wire::StatusReply& status, std::size_t line_width_max) {
  std::string text = service_lines(status, line_width_max);
  if (status.campaigns.empty()) return text + "no campaigns\n" + service_notes(status);
  text += table_of(status_columns, status.campaigns, campaign_cells, line_width_max);
  for (const CampaignStatus& campaign : status.campaigns) {
    for (const std::string& note : notes_about(campaign)) {
      text += fmt::format("{}: {}\n", campaign.name, note);
    }
  }
  text += further(status.num_campaigns, status.campaigns.size(), "more campaign");
  return text + service_notes(status);
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
      fmt::format("{} {}: {} of {}, {} %", campaign.name, wire::name_of(campaign.phase),
                  campaign.num_done, counted(campaign.num_runs, "run"), percent_done(campaign));
  if (!is_over(campaign)) {
    if (campaign.rate_hz > 0.0) text += fmt::format(", {} runs/s", rate(campaign));
    if (campaign.remaining_s) text += fmt::format(", {} left", time_left(campaign));
  }
  for (const std::string& note : notes_about(campaign)) text += "; " + note;
  return text;
}

namespace {

using Json = nlohmann::ordered_json;

std::string dumped(const Json& json, JsonLayout layout) {
  constexpr int indent = 2;
  return (layout == JsonLayout::indented ? json.dump(indent) : json.dump()) + "\n";
}

Json json_of(const wire::CampaignStatus& campaign) {
  Json json{{"name", campaign.name},
            {"phase", wire::name_of(campaign.phase)},
            {"priority", campaign.priority},
            {"num_runs", campaign.num_runs},
            {"num_done", campaign.num_done},
            {"num_without_estimate", campaign.num_without_estimate},
            {"num_given_up", campaign.num_given_up},
            {"num_lent", campaign.num_lent},
            {"num_duplicates", campaign.num_duplicates},
            {"num_audited", campaign.num_audited},
            {"num_mismatches", campaign.num_mismatches},
            {"rate_hz", campaign.rate_hz},
            {"remaining_s", nullptr},
            {"storage_failure", nullptr},
            {"owner", nullptr}};
  if (campaign.remaining_s) json["remaining_s"] = *campaign.remaining_s;
  if (!campaign.storage_failure.empty()) json["storage_failure"] = campaign.storage_failure;
  if (!campaign.owner.empty()) json["owner"] = campaign.owner;
  return json;
}

Json json_of(const wire::WorkerStatus& worker) {
  return {{"worker_id", worker.id.value},
          {"name", worker.name},
          {"host", worker.host},
          {"process_id", worker.process_id},
          {"num_slots", worker.num_slots},
          {"num_lent", worker.num_lent},
          {"num_results", worker.num_results},
          {"silent_s", worker.silent_s},
          {"is_quarantined", worker.is_quarantined}};
}

Json json_of(const wire::FactoryStatus& factory) {
  const wire::FactoryReport& report = factory.report;
  Json json{{"name", report.name},
            {"batch_system", report.batch_system},
            {"phase", wire::name_of(report.phase)},
            {"num_wanted", report.num_wanted},
            {"num_registered", report.num_registered},
            {"num_queued", report.num_queued},
            {"wait_s", nullptr},
            {"reason", nullptr},
            {"interval_s", report.interval_s},
            {"silent_s", factory.silent_s},
            {"owner", nullptr}};
  if (report.phase == wire::FactoryPhase::waiting) json["wait_s"] = report.wait_s;
  if (!report.reason.empty()) json["reason"] = report.reason;
  if (!factory.owner.empty()) json["owner"] = factory.owner;
  return json;
}

}  // namespace

std::string status_json(const wire::StatusReply& status, JsonLayout layout) {
  Json json{{"version", status.version},     {"model_version", status.model_version},
            {"uptime_s", status.uptime_s},   {"num_workers", status.num_workers},
            {"num_slots", status.num_slots}, {"campaigns", Json::array()}};
  for (const auto& campaign : status.campaigns) json["campaigns"].push_back(json_of(campaign));
  json["unserved_files"] = Json::array();
  for (const wire::UnservedFile& file : status.unserved_files) {
    json["unserved_files"].push_back({{"file", file.file}, {"reason", file.reason}});
  }
  json["num_unserved_files"] = status.num_unserved_files;
  json["quarantined_hosts"] = status.quarantined_hosts;
  json["num_quarantined_hosts"] = status.num_quarantined_hosts;
  json["factories"] = Json::array();
  for (const auto& factory : status.factories) json["factories"].push_back(json_of(factory));
  return dumped(json, layout);
}

std::string workers_json(const wire::WorkersReply& workers) {
  Json json{{"workers", Json::array()}};
  for (const auto& worker : workers.workers) json["workers"].push_back(json_of(worker));
  return dumped(json, JsonLayout::indented);
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
