#include "coordinator/report/status_notes.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>

#include "coordinator/report/json.hpp"
#include "coordinator/table/table.hpp"
#include "proto/text/visible_text.hpp"
#include "proto/wire/names.hpp"

namespace proofmass::coordinator {

std::span<const CampaignCounter> campaign_counters() {
  static constexpr std::array counters{
      CampaignCounter{"num_runs", &proto::CampaignStatus::num_runs, "proofmass_runs_wanted",
                      "Runs that the campaign is to have."},
      CampaignCounter{"num_done", &proto::CampaignStatus::num_done, "proofmass_runs_finished_total",
                      "Runs whose results are on disk."},
      CampaignCounter{"num_without_estimate", &proto::CampaignStatus::num_without_estimate,
                      "proofmass_runs_without_estimate_total",
                      "Finished runs without an estimate."},
      CampaignCounter{"num_suspects", &proto::CampaignStatus::num_suspects,
                      "proofmass_runs_suspect", "Open runs that crashed workers."},
      CampaignCounter{"num_given_up", &proto::CampaignStatus::num_given_up,
                      "proofmass_runs_given_up", "Runs that crashed too many workers."},
      CampaignCounter{"num_lent", &proto::CampaignStatus::num_lent, "proofmass_runs_lent",
                      "Runs that workers hold."},
      CampaignCounter{"num_duplicates", &proto::CampaignStatus::num_duplicates,
                      "proofmass_results_duplicate_total", "Results that were there already."},
      CampaignCounter{"num_audited", &proto::CampaignStatus::num_audited,
                      "proofmass_results_compared_total",
                      "Results that were compared with a second computation."},
      CampaignCounter{"num_mismatches", &proto::CampaignStatus::num_mismatches,
                      "proofmass_results_different_total",
                      "Compared results that differ; must be 0."},
  };
  return counters;
}

std::uint64_t percent_done(const proto::CampaignStatus& campaign) {
  return campaign.num_done() * 100 / std::max<std::uint64_t>(1, campaign.num_runs());
}

bool is_over(const proto::CampaignStatus& campaign) {
  return campaign.phase() == proto::CAMPAIGN_PHASE_FINISHED ||
         campaign.phase() == proto::CAMPAIGN_PHASE_CANCELLED;
}

std::string rate_text(const proto::CampaignStatus& campaign) {
  return campaign.rate_hz() > 0.0 ? measured_figure(campaign.rate_hz()) : "-";
}

std::string time_left_text(const proto::CampaignStatus& campaign) {
  const bool is_known = campaign.has_remaining_s() && !is_over(campaign);
  return is_known ? duration_text(campaign.remaining_s()) : "-";
}

std::vector<Column> campaign_columns() {
  return {{"campaign", true, 17}, {"phase", true, 10},     {"prio", false, 5},
          {"done", false, 11},    {"runs", false, 11},     {"%", false, 5},
          {"runs/s", false, 8},   {"time left", false, 12}};
}

Row campaign_row(const proto::CampaignStatus& campaign) {
  const auto count = [](std::uint64_t number) {
    Cell cell(std::to_string(number));
    cell.document = grouped(number);
    return cell;
  };
  return {campaign.name(),
          wire::phase_name(campaign),
          std::to_string(campaign.priority()),
          count(campaign.num_done()),
          count(campaign.num_runs()),
          std::to_string(percent_done(campaign)),
          rate_text(campaign),
          time_left_text(campaign)};
}

std::string further_note(std::uint64_t count, int num_shown, std::string_view thing) {
  const auto shown = static_cast<std::uint64_t>(num_shown);
  return count > shown ? fmt::format("and {}", counted(count - shown, thing)) : "";
}

namespace {

Remark comparison_note(const proto::CampaignStatus& campaign) {
  const std::string compared =
      counted(campaign.num_audited(), "result") + " compared with a second computation: ";
  if (campaign.num_mismatches() == 0) return {compared + "all equal"};
  return {compared + fmt::format("{} differ (none may)", campaign.num_mismatches()), Tone::bad};
}

}  // namespace

std::string service_line(const proto::StatusReply& status, std::set<std::string> versions) {
  versions.erase("");
  // A campaign that is finished may be of another version of the program's model.
  const std::string& own = status.model_version();
  const auto num_own = std::erase_if(
      versions, [family = own.substr(0, own.rfind('-') + 1)](const std::string& version) {
        return !family.empty() && version.starts_with(family);
      });
  if (versions.empty() || num_own > 0) versions.insert(own);
  return fmt::format("Proofmass {}, model{} {}, up {}", status.version(),
                     versions.size() > 1 ? "s" : "", fmt::join(versions, ", "),
                     duration_text(status.uptime_s()));
}

std::vector<Remark> notes_about(const proto::CampaignStatus& campaign) {
  std::vector<Remark> notes;
  const auto add_trouble = [&](std::string text) { notes.push_back({std::move(text), Tone::bad}); };
  if (!campaign.storage_failure().empty()) {
    add_trouble("nothing can be stored: " + wire::visible_text(campaign.storage_failure()));
  }
  if (!campaign.missing_model().empty()) {
    const std::string& refusal = campaign.model_refusal();
    add_trouble("no worker has the model " + wire::visible_text(campaign.missing_model()) +
                (refusal.empty() ? "" : "; the last refused: " + wire::visible_text(refusal)));
  }
  if (campaign.crashes_everywhere()) {
    add_trouble(
        "its model crashes at each worker, whose log says why; tried again within ten minutes");
  }
  if (campaign.has_failures_max()) {
    add_trouble(fmt::format("more than {} have no estimate: --failures cancelled it",
                            counted(campaign.failures_max(), "run")));
  }
  if (campaign.num_given_up() > 0) {
    add_trouble(counted(campaign.num_given_up(), "run") + " given up: crashed too often");
  }
  if (campaign.num_suspects() > 0 && !campaign.crashes_everywhere()) {
    add_trouble(counted(campaign.num_suspects(), "run") + " crashed: tried again last, alone");
  }
  if (campaign.num_without_estimate() > 0) {
    add_trouble(counted(campaign.num_without_estimate(), "run") + " without an estimate");
  }
  if (campaign.num_audited() > 0 || campaign.num_mismatches() > 0) {
    notes.push_back(comparison_note(campaign));
  }
  return notes;
}

namespace {

std::string quarantine_note(const std::string& host) {
  return fmt::format(
      "host {0} is in quarantine: too many workers crashed there; `proofmass release {0} --connect "
      "ADDRESS`",
      host);
}

std::string refusal_note(const proto::StatusReply& status) {
  if (status.num_refusals() == 0) return {};
  return fmt::format("{} refused; the last {} ago: {}", counted(status.num_refusals(), "worker"),
                     duration_text(status.last_refusal_s()),
                     wire::visible_text(status.last_refusal()));
}

std::string factory_note(const proto::FactoryStatus& factory) {
  const proto::FactoryReport& report = factory.report();
  std::string note = fmt::format(
      "factory {} ({}) {}: {} wanted, {} registered, {} in the queue", report.name(),
      report.batch_system(), wire::name_of(report.phase()), counted(report.num_wanted(), "worker"),
      report.num_registered(), report.num_queued());
  if (report.phase() == proto::FACTORY_PHASE_WAITING) {
    const double left_s = std::max(0.0, report.wait_s() - factory.silent_s());
    note += fmt::format("; tries again in {}", duration_text(left_s));
  }
  if (!report.reason().empty()) note += "; " + wire::visible_text(report.reason());
  return note;
}

}  // namespace

std::vector<Remark> service_notes(const proto::StatusReply& status) {
  std::vector<Remark> notes;
  const auto add = [&](std::string note, Tone tone) {
    if (!note.empty()) notes.push_back({std::move(note), tone});
  };
  for (const proto::UnservedFile& file : status.unserved_files()) {
    add("not served, tried again: " + wire::visible_text(file.reason()), Tone::bad);
  }
  add(further_note(status.num_unserved_files(), status.unserved_files_size(), "more such file"),
      Tone::plain);
  add(refusal_note(status), Tone::bad);
  for (const std::string& host : status.quarantined_hosts()) add(quarantine_note(host), Tone::bad);
  add(further_note(status.num_quarantined_hosts(), status.quarantined_hosts_size(),
                   "more such host"),
      Tone::plain);
  for (const proto::FactoryStatus& factory : status.factories()) {
    add(factory_note(factory), Tone::plain);
  }
  return notes;
}

namespace {

/// Null where there is nothing to say.
Json or_null(bool is_known, double value) { return is_known ? Json(value) : Json(nullptr); }

Json factory_object(const proto::FactoryStatus& factory) {
  const proto::FactoryReport& report = factory.report();
  const bool is_waiting = report.phase() == proto::FACTORY_PHASE_WAITING;
  return {{"name", report.name()},
          {"batch_system", report.batch_system()},
          {"phase", wire::name_of(report.phase())},
          {"num_wanted", report.num_wanted()},
          {"num_registered", report.num_registered()},
          {"num_queued", report.num_queued()},
          {"wait_s", or_null(is_waiting, report.wait_s())},
          {"reason", text_or_null(report.reason())},
          {"interval_s", report.interval_s()},
          {"silent_s", factory.silent_s()},
          {"owner", text_or_null(factory.owner())}};
}

Json campaign_object(const proto::CampaignStatus& campaign) {
  Json json{{"name", campaign.name()},
            {"phase", wire::phase_name(campaign)},
            {"priority", campaign.priority()}};
  for (const CampaignCounter& counter : campaign_counters()) {
    json[std::string(counter.name)] = (campaign.*counter.count)();
  }
  json.update({{"rate_hz", campaign.rate_hz()},
               {"remaining_s", or_null(campaign.has_remaining_s(), campaign.remaining_s())},
               {"storage_failure", text_or_null(campaign.storage_failure())},
               {"model_version", text_or_null(campaign.model_version())},
               {"missing_model", text_or_null(campaign.missing_model())},
               {"model_refusal", text_or_null(campaign.model_refusal())},
               {"crashes_everywhere", campaign.crashes_everywhere()},
               {"owner", text_or_null(campaign.owner())}});
  return json;
}

Json worker_object(const proto::WorkerStatus& worker) {
  return {{"worker_id", worker.worker_id()},
          {"name", worker.name()},
          {"host", worker.host()},
          {"process_id", worker.process_id()},
          {"num_slots", worker.num_slots()},
          {"num_lent", worker.num_lent()},
          {"num_results", worker.num_results()},
          {"silent_s", worker.silent_s()},
          {"is_quarantined", worker.is_quarantined()},
          {"cards", text_or_null(worker.cards())},
          {"card_rate_hz", or_null(worker.card_rate_hz() > 0.0, worker.card_rate_hz())}};
}

}  // namespace

Json status_json(const proto::StatusReply& status) {
  const auto of_file = [](const proto::UnservedFile& file) -> Json {
    return {{"file", file.file()}, {"reason", file.reason()}};
  };
  return {{"version", status.version()},
          {"model_version", status.model_version()},
          {"uptime_s", status.uptime_s()},
          {"num_workers", status.num_workers()},
          {"num_slots", status.num_slots()},
          {"campaigns", array_of(status.campaigns(), campaign_object)},
          {"unserved_files", array_of(status.unserved_files(), of_file)},
          {"num_unserved_files", status.num_unserved_files()},
          {"quarantined_hosts", status.quarantined_hosts()},
          {"num_quarantined_hosts", status.num_quarantined_hosts()},
          {"num_refusals", status.num_refusals()},
          {"last_refusal", text_or_null(status.last_refusal())},
          {"last_refusal_s", or_null(status.num_refusals() > 0, status.last_refusal_s())},
          {"factories", array_of(status.factories(), factory_object)}};
}

Json workers_json(const proto::WorkersReply& workers) {
  return {{"workers", array_of(workers.workers(), worker_object)}};
}

}  // namespace proofmass::coordinator
