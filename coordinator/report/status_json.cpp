#include "coordinator/report/status_json.hpp"

#include "coordinator/report/json.hpp"
#include "coordinator/report/status_notes.hpp"
#include "proto/wire/names.hpp"

namespace proofmass::coordinator {
namespace {

/// Null where there is nothing to say.
Json or_null(bool is_known, double value) { return is_known ? Json(value) : Json(nullptr); }
Json text_or_null(const std::string& text) { return text.empty() ? Json(nullptr) : Json(text); }

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

Json status_object(const proto::StatusReply& status) {
  Json json{{"version", status.version()},     {"model_version", status.model_version()},
            {"uptime_s", status.uptime_s()},   {"num_workers", status.num_workers()},
            {"num_slots", status.num_slots()}, {"campaigns", Json::array()}};
  for (const auto& campaign : status.campaigns())
    json["campaigns"].push_back(campaign_object(campaign));
  json["unserved_files"] = Json::array();
  for (const proto::UnservedFile& file : status.unserved_files()) {
    json["unserved_files"].push_back({{"file", file.file()}, {"reason", file.reason()}});
  }
  json["num_unserved_files"] = status.num_unserved_files();
  json["quarantined_hosts"] = status.quarantined_hosts();
  json["num_quarantined_hosts"] = status.num_quarantined_hosts();
  json["num_refusals"] = status.num_refusals();
  json["last_refusal"] = text_or_null(status.last_refusal());
  json["last_refusal_s"] = or_null(status.num_refusals() > 0, status.last_refusal_s());
  json["factories"] = Json::array();
  for (const auto& factory : status.factories())
    json["factories"].push_back(factory_object(factory));
  return json;
}

}  // namespace

std::string dumped(const Json& json, JsonLayout layout) {
  constexpr auto replace = Json::error_handler_t::replace;
  return json.dump(layout == JsonLayout::indented ? 2 : -1, ' ', false, replace) + "\n";
}

std::string status_json(const proto::StatusReply& status, JsonLayout layout) {
  return dumped(status_object(status), layout);
}

std::string workers_json(const proto::WorkersReply& workers) {
  Json json{{"workers", Json::array()}};
  for (const auto& worker : workers.workers()) json["workers"].push_back(worker_object(worker));
  return dumped(json, JsonLayout::indented);
}

}  // namespace proofmass::coordinator
