#include "coordinator/cli/client_json.hpp"

#include <nlohmann/json.hpp>

#include "proto/wire/names.hpp"

namespace proofmass::coordinator {
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
