#include "coordinator/cli/client_json.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>

namespace proofmass::coordinator {
namespace {

using Json = nlohmann::json;

wire::StatusReply some_status() {
  wire::StatusReply status{.version = "0.1.0",
                           .model_version = "m-2",
                           .uptime_s = 1.5,
                           .num_workers = 2,
                           .num_slots = 3,
                           .campaigns = {}};
  status.campaigns.push_back({.name = "a",
                              .phase = wire::CampaignPhase::paused,
                              .priority = -1,
                              .num_runs = 100,
                              .num_done = 11,
                              .num_without_estimate = 2,
                              .num_given_up = 3,
                              .num_lent = 4,
                              .num_duplicates = 5,
                              .num_audited = 6,
                              .num_mismatches = 7,
                              .rate_hz = 0.5,
                              .remaining_s = 2.5,
                              .storage_failure = "disk full",
                              .owner = "anna"});
  status.num_campaigns = 1;
  status.unserved_files = {{.file = "d/a.db", .reason = "is locked"}};
  status.num_unserved_files = 2;
  status.quarantined_hosts = {"n7"};
  status.num_quarantined_hosts = 1;
  return status;
}

TEST(StatusJson, HoldsEverythingUnderStableKeys) {
  const Json expected{{"version", "0.1.0"},
                      {"model_version", "m-2"},
                      {"uptime_s", 1.5},
                      {"num_workers", 2},
                      {"num_slots", 3},
                      {"campaigns",
                       {{{"name", "a"},
                         {"phase", "paused"},
                         {"priority", -1},
                         {"num_runs", 100},
                         {"num_done", 11},
                         {"num_without_estimate", 2},
                         {"num_given_up", 3},
                         {"num_lent", 4},
                         {"num_duplicates", 5},
                         {"num_audited", 6},
                         {"num_mismatches", 7},
                         {"rate_hz", 0.5},
                         {"remaining_s", 2.5},
                         {"storage_failure", "disk full"},
                         {"owner", "anna"}}}},
                      {"unserved_files", {{{"file", "d/a.db"}, {"reason", "is locked"}}}},
                      {"num_unserved_files", 2},
                      {"quarantined_hosts", {"n7"}},
                      {"num_quarantined_hosts", 1}};
  EXPECT_EQ(Json::parse(status_json(some_status(), JsonLayout::indented)), expected);
  EXPECT_EQ(Json::parse(status_json(some_status(), JsonLayout::one_line)), expected);
}

TEST(StatusJson, HasNullForWhatIsNotKnownOrDidNotHappen) {
  wire::StatusReply status = some_status();
  status.campaigns[0].remaining_s.reset();
  status.campaigns[0].storage_failure.clear();
  const Json json = Json::parse(status_json(status, JsonLayout::indented));
  EXPECT_TRUE(json["campaigns"][0]["remaining_s"].is_null());
  EXPECT_TRUE(json["campaigns"][0]["storage_failure"].is_null());
}

TEST(StatusJson, HasAListAlsoWithoutCampaigns) {
  EXPECT_TRUE(Json::parse(status_json({}, JsonLayout::indented))["campaigns"].is_array());
}

TEST(StatusJson, MayStandOnOneLine) {
  const std::string text = status_json(some_status(), JsonLayout::one_line);
  EXPECT_EQ(std::ranges::count(text, '\n'), 1);
  EXPECT_TRUE(text.ends_with("}\n"));
}

TEST(WorkersJson, HoldsEverythingUnderStableKeys) {
  const wire::WorkersReply reply{.workers = {{.id = {3},
                                              .name = "w",
                                              .host = "h",
                                              .process_id = 4,
                                              .num_slots = 5,
                                              .num_lent = 6,
                                              .num_results = 7,
                                              .silent_s = 0.5,
                                              .is_quarantined = true}}};
  const Json expected{{"workers",
                       {{{"worker_id", 3},
                         {"name", "w"},
                         {"host", "h"},
                         {"process_id", 4},
                         {"num_slots", 5},
                         {"num_lent", 6},
                         {"num_results", 7},
                         {"silent_s", 0.5},
                         {"is_quarantined", true}}}}};
  EXPECT_EQ(Json::parse(workers_json(reply)), expected);
  EXPECT_TRUE(Json::parse(workers_json({}))["workers"].is_array());
}

TEST(DoneJson, SaysWhatWasDoneToWhat) {
  EXPECT_EQ(Json::parse(done_json("pause", "a", {"campaign a: paused"})),
            Json({{"action", "pause"}, {"campaign", "a"}, {"text", "campaign a: paused"}}));
}

}  // namespace
}  // namespace proofmass::coordinator
