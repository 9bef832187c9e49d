#include "coordinator/report/status_json.hpp"

#include <nlohmann/json.hpp>

#include "coordinator/report/status_notes.hpp"
#include "proto/wire/names.hpp"

namespace proofmass::coordinator {
namespace {

using StatusJson = nlohmann::ordered_json;

StatusJson factory_object(const proto::FactoryStatus& factory) {
  const proto::FactoryReport& report = factory.report();
  StatusJson json{{"name", report.name()},
                  {"batch_system", report.batch_system()},
                  {"phase", wire::name_of(report.phase())},
                  {"num_wanted", report.num_wanted()},
                  {"num_registered", report.num_registered()},
                  {"num_queued", report.num_queued()},
                  {"wait_s", nullptr},
                  {"reason", nullptr},
                  {"interval_s", report.interval_s()},
                  {"silent_s", factory.silent_s()},
                  {"owner", nullptr}};
  if (report.phase() == proto::FACTORY_PHASE_WAITING) json["wait_s"] = report.wait_s();
  if (!report.reason().empty()) json["reason"] = report.reason();
  if (!factory.owner().empty()) json["owner"] = factory.owner();
  return json;
}

StatusJson campaign_object(const proto::CampaignStatus& campaign) {
  StatusJson json{{"name", campaign.name()},
                  {"phase", wire::phase_name(campaign)},
                  {"priority", campaign.priority()}};
  for (const CampaignCounter& counter : campaign_counters()) {
    json[std::string(counter.name)] = (campaign.*counter.count)();
  }
  json.update({{"rate_hz", campaign.rate_hz()},
               {"remaining_s", nullptr},
               {"storage_failure", nullptr},
               {"missing_model", nullptr},
               {"owner", nullptr}});
  if (campaign.has_remaining_s()) json["remaining_s"] = campaign.remaining_s();
  if (!campaign.storage_failure().empty()) json["storage_failure"] = campaign.storage_failure();
  if (!campaign.missing_model().empty()) json["missing_model"] = campaign.missing_model();
  if (!campaign.owner().empty()) json["owner"] = campaign.owner();
  return json;
}

StatusJson worker_object(const proto::WorkerStatus& worker) {
  StatusJson json{{"worker_id", worker.worker_id()},
                  {"name", worker.name()},
                  {"host", worker.host()},
                  {"process_id", worker.process_id()},
                  {"num_slots", worker.num_slots()},
                  {"num_lent", worker.num_lent()},
                  {"num_results", worker.num_results()},
                  {"silent_s", worker.silent_s()},
                  {"is_quarantined", worker.is_quarantined()},
                  {"cards", nullptr},
                  {"card_rate_hz", nullptr}};
  if (!worker.cards().empty()) json["cards"] = worker.cards();
  if (worker.card_rate_hz() > 0.0) json["card_rate_hz"] = worker.card_rate_hz();
  return json;
}

StatusJson status_object(const proto::StatusReply& status) {
  StatusJson json{{"version", status.version()},     {"model_version", status.model_version()},
                  {"uptime_s", status.uptime_s()},   {"num_workers", status.num_workers()},
                  {"num_slots", status.num_slots()}, {"campaigns", StatusJson::array()}};
  for (const auto& campaign : status.campaigns())
    json["campaigns"].push_back(campaign_object(campaign));
  json["unserved_files"] = StatusJson::array();
  for (const proto::UnservedFile& file : status.unserved_files()) {
    json["unserved_files"].push_back({{"file", file.file()}, {"reason", file.reason()}});
  }
  json["num_unserved_files"] = status.num_unserved_files();
  json["quarantined_hosts"] = StatusJson::array();
  for (const auto& host : status.quarantined_hosts()) json["quarantined_hosts"].push_back(host);
  json["num_quarantined_hosts"] = status.num_quarantined_hosts();
  json["factories"] = StatusJson::array();
  for (const auto& factory : status.factories())
    json["factories"].push_back(factory_object(factory));
  return json;
}

}  // namespace

std::string dumped(const nlohmann::ordered_json& json, JsonLayout layout) {
  constexpr auto replace = nlohmann::ordered_json::error_handler_t::replace;
  return json.dump(layout == JsonLayout::indented ? 2 : -1, ' ', false, replace) + "\n";
}

std::string status_json(const proto::StatusReply& status, JsonLayout layout) {
  return dumped(status_object(status), layout);
}

std::string workers_json(const proto::WorkersReply& workers) {
  StatusJson json{{"workers", StatusJson::array()}};
  for (const auto& worker : workers.workers()) json["workers"].push_back(worker_object(worker));
  return dumped(json, JsonLayout::indented);
}

}  // namespace proofmass::coordinator
