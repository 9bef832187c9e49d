#include "coordinator/cli/client_text.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>

#include "core/runs.hpp"

namespace proofmass::coordinator {
namespace {

wire::CampaignStatus campaign(const std::string& name, std::uint64_t num_done) {
  wire::CampaignStatus status;
  status.name = name;
  status.num_runs = 100;
  status.num_done = num_done;
  return status;
}

wire::StatusReply status_with(const std::vector<wire::CampaignStatus>& campaigns) {
  return {.version = "0.1.0",
          .model_version = "hardy2013-2",
          .uptime_s = 12000.0,
          .num_workers = 12,
          .num_slots = 48,
          .campaigns = campaigns};
}

wire::WorkerStatus worker(std::uint64_t id, const std::string& name) {
  wire::WorkerStatus status;
  status.id = {id};
  status.name = name;
  status.host = fmt::format("n{}", id);
  status.process_id = 4711;
  status.num_slots = 4;
  status.num_lent = 64;
  status.num_results = 1234;
  status.silent_s = 2.9;
  return status;
}

void expect_width_at_most(const std::string& text, std::size_t width) {
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) EXPECT_LE(display_width(line), width) << line;
}

TEST(StatusTable, ShowsFilesThatAreNotServedAndHostsInQuarantine) {
  wire::StatusReply status = status_with({campaign("a", 1)});
  status.num_campaigns = 3;
  status.unserved_files = {{.file = "d/b.db", .reason = "campaign database = d/b.db (is locked)"}};
  status.num_unserved_files = 2;
  status.quarantined_hosts = {"n7"};
  status.num_quarantined_hosts = 1;
  const std::string text = status_text(status, {.line_width_max = 79});
  EXPECT_TRUE(
      text.ends_with("and 2 more campaigns\n"
                     "not served, tried again: campaign database = d/b.db (is locked)\n"
                     "and 1 more such file\n"
                     "host n7 is in quarantine: too many workers crashed there; "
                     "`proofmass release n7`\n"))
      << text;
}

// A file that somebody made may have any name of a campaign in it, and the reason may quote it.
TEST(StatusTable, ShowsAReasonInOneLine) {
  wire::StatusReply status = status_with({campaign("a", 1)});
  status.campaigns[0].storage_failure = "full\nb: all is well";
  status.unserved_files = {{.file = "d/b.db", .reason = "d/b.db: campaign b\nc \x1b[2J"}};
  const std::string text = status_text(status, {.line_width_max = 79});
  EXPECT_TRUE(
      text.ends_with("a: nothing can be stored: full\\nb: all is well\n"
                     "not served, tried again: d/b.db: campaign b\\nc \\u001b[2J\n"))
      << text;
}

wire::FactoryStatus factory(wire::FactoryPhase phase, double wait_s, const std::string& reason) {
  return {.report = {.name = "fleet",
                     .batch_system = "pbs",
                     .phase = phase,
                     .num_wanted = 3,
                     .num_registered = 2,
                     .num_queued = 1,
                     .wait_s = wait_s,
                     .reason = reason,
                     .interval_s = 30},
          .owner = "anna",
          .silent_s = 12.0};
}

TEST(StatusTable, ShowsFactoriesAndWhyTheyDoNotSubmit) {
  using wire::FactoryPhase;
  wire::StatusReply status = status_with({});
  status.factories = {factory(FactoryPhase::active, 0.0, ""),
                      factory(FactoryPhase::waiting, 60.0, "submission: qsub: queue\nfull"),
                      factory(FactoryPhase::waiting, 5.0, "late"),
                      factory(FactoryPhase::paused, 0.0, "3 workers in a row did not start")};
  const std::string counts = ": 3 workers wanted, 2 registered, 1 in the queue";
  const std::string text = status_text(status, {.line_width_max = 79});
  EXPECT_TRUE(
      text.ends_with("no campaigns\n"
                     "factory fleet (pbs) active" +
                     counts + "\nfactory fleet (pbs) waiting" + counts +
                     "; tries again in 48 s; submission: qsub: queue\\nfull\n"
                     "factory fleet (pbs) waiting" +
                     counts + "; tries again in 0 s; late\nfactory fleet (pbs) paused" + counts +
                     "; 3 workers in a row did not start\n"))
      << text;
}

TEST(StatusTable, ShowsCampaignsAndWhatIsOutOfTheOrdinary) {
  wire::CampaignStatus first = campaign("hardy2013", 42);
  first.rate_hz = 12.34;
  first.remaining_s = 200.0;
  first.num_lent = 16;
  wire::CampaignStatus second = campaign("second-order", 97);
  second.phase = wire::CampaignPhase::paused;
  second.priority = -5;
  second.num_given_up = 1;
  second.num_without_estimate = 2;
  second.num_audited = 10;
  second.num_mismatches = 3;
  EXPECT_EQ(status_text(status_with({first, second}), {.line_width_max = 79}),
            R"(Proofmass 0.1.0, model hardy2013-2, up 3 h 20 min
12 workers with 48 slots, 16 runs lent

campaign         phase      prio       done       runs    %  runs/s   time left
───────────────────────────────────────────────────────────────────────────────
hardy2013        active        0         42        100   42    12.3  3 min 20 s
second-order     paused       -5         97        100   97       -           -
second-order: 1 run given up: too many workers crashed
second-order: 2 runs without an estimate
second-order: 10 results compared with a second computation: 3 differ (none may)
)");
}

TEST(StatusTable, GivesALongNameTheRoomThatTheLineHas) {
  const std::string name(30, 'x');
  const wire::StatusReply status = status_with({campaign(name, 1), campaign("b", 1)});
  const std::string text = status_text(status, {.line_width_max = 200});
  EXPECT_NE(text.find("\n" + name + " active "), std::string::npos) << text;
  EXPECT_NE(text.find("\nb" + std::string(30, ' ') + "active "), std::string::npos) << text;
  expect_width_at_most(status_text(status, {.line_width_max = 85}), 85);
  EXPECT_NE(status_text(status, {.line_width_max = 85}).find("\nxxxxxxxxxxxxxxxxxxxxx… active "),
            std::string::npos);
}

TEST(StatusTable, HasAtMost79Columns) {
  wire::CampaignStatus wide = campaign(std::string(128, 'x'), num_runs_max);
  wide.phase = wire::CampaignPhase::cancelled;
  wide.priority = -100;
  wide.num_runs = num_runs_max;
  for (const double number : {1e-12, 1.0, 59.0 * 60.0 + 59.0, 1e300}) {
    wide.rate_hz = number;
    wide.remaining_s = number;
    wire::StatusReply status = status_with({wide});
    status.version = std::string(128, 'v');
    status.num_slots = std::numeric_limits<std::uint64_t>::max();
    expect_width_at_most(status_text(status, {.line_width_max = 79}), 79);
  }
}

TEST(StatusTable, CutsNothingInAFile) {
  wire::StatusReply status = status_with({campaign(std::string(128, 'x'), 1)});
  status.model_version = std::string(128, 'm');
  const std::string table = status_text(status, {});
  EXPECT_NE(table.find(std::string(128, 'x') + " "), std::string::npos) << table;
  EXPECT_NE(table.find(std::string(128, 'm') + ","), std::string::npos) << table;
}

TEST(StatusTable, MarksTroubleAndNothingElse) {
  wire::CampaignStatus status = campaign("mine", 1);
  status.storage_failure = "disk full";
  status.num_given_up = 2;
  status.num_without_estimate = 3;
  status.num_audited = status.num_mismatches = 1;
  wire::StatusReply reply = status_with({status});
  reply.unserved_files = {{.file = "b.db", .reason = "is damaged"}};
  reply.quarantined_hosts = {"node7"};
  const std::string text = status_text(reply, {.paint = Paint::yes});
  const std::string bad = "\033[1;38;5;130m", plain = "\033[0m";
  for (const std::string line :
       {"mine: nothing can be stored: disk full", "mine: 2 runs given up: too many workers crashed",
        "mine: 3 runs without an estimate",
        "mine: 1 result compared with a second computation: 1 differ (none may)",
        "not served, tried again: is damaged",
        "host node7 is in quarantine: too many workers crashed there; `proofmass release node7`"}) {
    EXPECT_NE(text.find(bad + line + plain + "\n"), std::string::npos) << line << "\n" << text;
  }
  EXPECT_EQ(std::ranges::count(text, '\033'), 14) << "and the titles";
}

TEST(WorkersTable, ShowsWorkersAndWhoIsInQuarantine) {
  wire::WorkerStatus second = worker(1234, "local-2");
  second.silent_s = 3.0 * 3600.0;
  second.is_quarantined = true;
  EXPECT_EQ(terminal_text(workers_table({.workers = {worker(7, "local-1"), second}}),
                          {.line_width_max = 79}),
            R"(      id  worker         host               pid slots    lent  results    heard
───────────────────────────────────────────────────────────────────────────────
       7  local-1        n7                4711     4      64     1234      2 s
    1234  local-2        n1234             4711     4      64     1234      3 h
1234: in quarantine, is lent nothing: too many crashes on n1234
)");
}

TEST(WorkersTable, HasAtMost79Columns) {
  constexpr auto most = std::numeric_limits<std::uint64_t>::max();
  wire::WorkerStatus wide = worker(most, std::string(128, 'x'));
  wide.host = std::string(128, 'y');
  wide.process_id = wide.num_slots = wide.num_lent = wide.num_results = most;
  wide.silent_s = 1e300;
  expect_width_at_most(terminal_text(workers_table({.workers = {wide}}), {.line_width_max = 79}),
                       79);
}

TEST(CampaignLine, SaysHowFarItIsAndHowFast) {
  wire::CampaignStatus status = campaign("hardy2013", 42);
  EXPECT_EQ(campaign_line(status), "hardy2013 active: 42 of 100 runs, 42 %");
  status.rate_hz = 0.5;
  status.remaining_s = 116.0;
  EXPECT_EQ(campaign_line(status),
            "hardy2013 active: 42 of 100 runs, 42 %, 0.500 runs/s, 1 min 56 s left");
  status.num_audited = 1;
  status.num_given_up = 2;
  EXPECT_EQ(campaign_line(status),
            "hardy2013 active: 42 of 100 runs, 42 %, 0.500 runs/s, 1 min 56 s left; 2 runs given "
            "up: too many workers crashed; 1 result compared with a second computation: all equal");
}

TEST(CampaignLine, SaysThatMostRunsWereGivenUp) {
  wire::CampaignStatus status = campaign("a", 40);
  status.phase = wire::CampaignPhase::finished;
  status.num_given_up = 50;
  EXPECT_TRUE(campaign_line(status).starts_with("a finished: 40 of 100 runs"));
  status.num_given_up = 51;
  EXPECT_TRUE(campaign_line(status).starts_with("a failed: 40 of 100 runs"));
}

}  // namespace

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
  status.factories = {{.report = {.name = "fleet",
                                  .batch_system = "pbs",
                                  .phase = wire::FactoryPhase::waiting,
                                  .num_wanted = 3,
                                  .num_registered = 2,
                                  .num_queued = 1,
                                  .wait_s = 60.5,
                                  .reason = "qsub: queue full",
                                  .interval_s = 30},
                       .owner = "anna",
                       .silent_s = 1.5}};
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
                      {"num_quarantined_hosts", 1},
                      {"factories",
                       {{{"name", "fleet"},
                         {"batch_system", "pbs"},
                         {"phase", "waiting"},
                         {"num_wanted", 3},
                         {"num_registered", 2},
                         {"num_queued", 1},
                         {"wait_s", 60.5},
                         {"reason", "qsub: queue full"},
                         {"interval_s", 30},
                         {"silent_s", 1.5},
                         {"owner", "anna"}}}}};
  EXPECT_EQ(Json::parse(status_json(some_status(), JsonLayout::indented)), expected);
  EXPECT_EQ(Json::parse(status_json(some_status(), JsonLayout::one_line)), expected);
}

TEST(StatusJson, HasNullForWhatIsNotKnownOrDidNotHappen) {
  wire::StatusReply status = some_status();
  status.campaigns[0].remaining_s.reset();
  status.campaigns[0].storage_failure.clear();
  status.factories = {{.report = {.name = "fleet", .batch_system = "pbs"}}};
  const Json json = Json::parse(status_json(status, JsonLayout::indented));
  EXPECT_TRUE(json["campaigns"][0]["remaining_s"].is_null());
  EXPECT_TRUE(json["campaigns"][0]["storage_failure"].is_null());
  for (const std::string key : {"wait_s", "reason", "owner"}) {
    EXPECT_TRUE(json["factories"][0][key].is_null()) << key;
  }
}

TEST(StatusJson, HasAListAlsoWithoutCampaigns) {
  EXPECT_TRUE(Json::parse(status_json({}, JsonLayout::indented))["campaigns"].is_array());
  EXPECT_TRUE(Json::parse(status_json({}, JsonLayout::indented))["factories"].is_array());
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

}  // namespace
}  // namespace proofmass::coordinator
