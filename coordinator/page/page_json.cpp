#include "coordinator/page/page_json.hpp"

#include <nlohmann/json.hpp>

#include "coordinator/report/status_json.hpp"

namespace proofmass::coordinator {
namespace {

using PageJson = nlohmann::ordered_json;

/// The first keys of every answer.
PageJson beginning(double age_s) { return {{"api_version", page_api_version}, {"age_s", age_s}}; }

PageJson object_of(const WorkerSnapshot& worker) {
  PageJson json = worker_object(worker.status);
  json["state"] = name_of(worker.activity);
  json["registered_s"] = worker.registered_s;
  json["results_per_h"] = results_per_h(worker);
  return json;
}

PageJson object_of(const CampaignSnapshot& campaign) {
  PageJson json = campaign_object(campaign.status);
  json["num_waiting"] = campaign.num_waiting;
  return json;
}

PageJson object_of(const StoredEvent& event) {
  return {{"event_id", event.id},
          {"time_utc", event.time_utc},
          {"kind", event.kind},
          {"text", event.text}};
}

PageJson losses_of(const CampaignEvents& events) {
  PageJson json = PageJson::array();
  for (const LossCount& loss : events.losses) {
    json.push_back({{"reason", loss.reason},
                    {"num_losses", loss.num_losses},
                    {"num_runs", loss.num_runs},
                    {"num_blamed", loss.num_blamed}});
  }
  return json;
}

PageJson ends_of(const CampaignEvents& events) {
  PageJson json = PageJson::array();
  for (const EndCount& end : events.ends) {
    PageJson item{{"status", end.status},
                  {"cause", nullptr},
                  {"session", nullptr},
                  {"num_runs", end.num_runs}};
    if (!end.cause.empty()) item["cause"] = end.cause;
    if (!end.session.empty()) item["session"] = end.session;
    json.push_back(std::move(item));
  }
  return json;
}

PageJson given_up_of(const CampaignEvents& events) {
  PageJson json = PageJson::array();
  for (const GivenUpRecord& run : events.given_up) {
    json.push_back({{"run", run.run.value},
                    {"reason", run.reason},
                    {"num_attempts", run.num_attempts},
                    {"given_up_utc", run.given_up_utc}});
  }
  return json;
}

/// Null before the results were read for the first time.
PageJson accuracy_of(const CampaignDetails& details, TimePoint now) {
  if (details.results == nullptr) return nullptr;
  const CampaignResults& results = *details.results;
  PageJson json{{"age_s", seconds(now - details.results_at)},
                {"num_runs", results.num_runs},
                {"failure", nullptr},
                {"parameters", PageJson::array()}};
  if (!results.failure.empty()) json["failure"] = results.failure;
  if (!results.json.empty()) json["parameters"] = PageJson::parse(results.json);
  return json;
}

}  // namespace

std::string status_answer(const PageSnapshot& snapshot, TimePoint now) {
  const ServiceSnapshot& service = snapshot.service;
  PageJson json = beginning(seconds(now - snapshot.taken_at));
  json.update(status_object(service.status));
  for (const CampaignSnapshot& campaign : service.campaigns) {
    json["campaigns"].push_back(object_of(campaign));
  }
  json["num_leases"] = service.num_leases;
  json["workers_by_state"] = PageJson::object();
  for (std::size_t i = 0; i < worker_activities.size(); ++i) {
    json["workers_by_state"][std::string(name_of(worker_activities[i]))] =
        service.num_workers_by_activity[i];
  }
  return dumped(json, JsonLayout::one_line);
}

std::string workers_answer(const PageSnapshot& snapshot, const PageRequest& request,
                           TimePoint now) {
  const ChosenWorkers chosen = choose_workers(snapshot.service.workers, worker_choice(request));
  PageJson json = beginning(seconds(now - snapshot.taken_at));
  json["page"] = chosen.list.page;
  json["num_pages"] = chosen.list.num_pages;
  json["num_workers"] = snapshot.service.workers.size();
  json["num_matching"] = chosen.list.count;
  json["workers"] = PageJson::array();
  for (const WorkerSnapshot* worker : chosen.workers) json["workers"].push_back(object_of(*worker));
  return dumped(json, JsonLayout::one_line);
}

std::string campaign_answer(const CampaignSnapshot& campaign, const CampaignDetails& details,
                            TimePoint now) {
  PageJson json = beginning(0.0);
  json.erase("age_s");
  json["campaign"] = object_of(campaign);
  json["details_age_s"] = nullptr;
  json["failure"] = nullptr;
  const bool has_details = details.events != nullptr;
  if (has_details) json["details_age_s"] = seconds(now - details.events_at);
  const CampaignEvents none;
  const CampaignEvents& events = has_details ? *details.events : none;
  if (!events.failure.empty()) json["failure"] = events.failure;
  json["ends_without_estimate"] = ends_of(events);
  json["given_up"] = given_up_of(events);
  json["losses"] = losses_of(events);
  json["accuracy"] = accuracy_of(details, now);
  json["last_event_id"] = events.events.empty() ? 0 : events.events.back().id;
  return dumped(json, JsonLayout::one_line);
}

std::string events_answer(const CampaignDetails& details, const PageRequest& request,
                          std::string_view campaign) {
  const std::uint64_t after = request.number("after").value_or(0);
  PageJson json{{"api_version", page_api_version},
                {"campaign", campaign},
                {"events", PageJson::array()},
                {"next_after", after},
                {"num_left", 0}};
  std::uint64_t num_left = 0;
  for (const StoredEvent& event : details.events->events) {
    if (event.id <= after) continue;
    if (json["events"].size() == events_per_answer_max) {
      ++num_left;
      continue;
    }
    json["events"].push_back(object_of(event));
    json["next_after"] = event.id;
  }
  json["num_left"] = num_left;
  return dumped(json, JsonLayout::one_line);
}

}  // namespace proofmass::coordinator
