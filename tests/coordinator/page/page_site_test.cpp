#include "coordinator/page/page_site.hpp"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/coordinator/page/page_fixture.hpp"

namespace proofmass::coordinator {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using test::page_secret;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::UnorderedElementsAreArray;

class PageSiteTest : public ::testing::Test {
 protected:
  PageSiteTest() {
    service.campaigns = {test::campaign_snapshot("a", 42, 100),
                         test::campaign_snapshot(test::hostile_name, 1, 2)};
    service.workers = test::many_workers(120);
    auto events = std::make_shared<CampaignEvents>();
    for (std::uint64_t id = 11; id <= 20; ++id) events->events.push_back({.id = id, .kind = "e"});
    details.events = events;
    turn();
  }
  void turn() {
    board.on_turn(now, [this](SnapshotDepth depth) {
      ServiceSnapshot copy = service;
      if (depth == SnapshotDepth::without_workers) copy.workers.clear();
      return copy;
    });
  }
  [[nodiscard]] PageSite site() {
    return PageSite({.access = PageAccess(token ? std::optional(PageToken(*token)) : std::nullopt),
                     .board = &board,
                     .details =
                         [this](const std::string& name, const DetailSubject& campaign, TimePoint) {
                           asked_for = name + " " + campaign.file.string();
                           return details;
                         },
                     .counts = [] { return HttpCounts{}; },
                     .now = [this] { return now; }});
  }
  /// After the turns of the service that the request waits for.
  HttpAnswer answer(const std::string& target, HttpRequest request = {.host = "localhost"}) {
    request.target = target;
    auto given = site().answer(request, HttpServer::Patience::left);
    if (!given) {
      turn();
      given = site().answer(request, HttpServer::Patience::over);
    }
    return given.value_or(HttpAnswer{.status = 0});
  }
  json json_of(const std::string& target) {
    const HttpAnswer given = answer(target);
    EXPECT_EQ(given.status, 200U) << target;
    EXPECT_EQ(given.content_type, "application/json") << target;
    return json::parse(given.body);
  }
  static std::vector<std::string> keys_of(const json& object) {
    std::vector<std::string> keys;
    for (const auto& item : object.items()) keys.push_back(item.key());
    return keys;
  }

  TimePoint now{1000s};
  SnapshotBoard board{now};
  ServiceSnapshot service;
  CampaignDetails details;
  std::optional<std::string> token;
  std::string asked_for;
};

TEST_F(PageSiteTest, HasAnAnswerAtEachAddress) {
  for (const std::string target :
       {"/", "/?page=1", "/workers", "/campaigns/a", "/style.css", "/script.js", "/metrics",
        "/healthz", "/api/status", "/api/workers", "/api/campaigns/a", "/api/campaigns/a/events",
        "/api/campaigns/a/trace"}) {
    EXPECT_EQ(answer(target).status, 200U) << target;
  }
}

TEST_F(PageSiteTest, HasNothingElsewhere) {
  for (const std::string target : {"/index.html",
                                   "/campaigns",
                                   "/campaigns/b",
                                   "/campaigns/a/x",
                                   "/campaigns/a/events",
                                   "/campaigns/../a",
                                   "/campaigns/%2e%2e",
                                   "/../etc/passwd",
                                   "/%2e%2e/%2e%2e/etc/passwd",
                                   "/api",
                                   "/api/x",
                                   "/api/campaigns",
                                   "/api/campaigns/b",
                                   "/api/campaigns/a/x",
                                   "/api/campaigns/a/events/x",
                                   "/api/workers/x",
                                   "/metrics/x",
                                   "/x/script.js",
                                   "/workers/x",
                                   "//",
                                   "/a.db",
                                   "",
                                   "x"}) {
    EXPECT_EQ(answer(target).status, 404U) << target;
  }
}

TEST_F(PageSiteTest, FindsACampaignByItsWholeName) {
  const std::string name = "<script>alert(\"1\")\n\x1b[31m&'\xff";  // No name has a `/`.
  service.campaigns = {test::campaign_snapshot(name, 1, 2)};
  const HttpAnswer page = answer("/campaigns/" + percent_encoded(name));
  EXPECT_EQ(page.status, 200U);
  EXPECT_THAT(page.body, Not(HasSubstr("<script>alert")));
  EXPECT_EQ(asked_for, name + " /nowhere/" + name + ".db");
}

TEST_F(PageSiteTest, GivesThePartThatChangesByItself) {
  const std::string whole = answer("/campaigns/a").body;
  const std::string fragment = answer("/campaigns/a?fragment=1").body;
  EXPECT_THAT(whole, testing::StartsWith("<!DOCTYPE html>"));
  EXPECT_THAT(fragment, Not(HasSubstr("<html")));
  EXPECT_THAT(whole, HasSubstr("<div id=\"live\">\n" + fragment + "</div>"));
}

TEST_F(PageSiteTest, WaitsForASnapshotThatIsNew) {
  now += 1h;
  const HttpRequest request{.target = "/", .host = "localhost"};
  EXPECT_FALSE(site().answer(request, HttpServer::Patience::left).has_value());
  // The service hangs: what it said an hour ago is shown, and how old it is.
  (void)answer("/");
  now += 1h;
  const auto late = site().answer(request, HttpServer::Patience::over);
  ASSERT_TRUE(late.has_value());
  EXPECT_THAT(late->body, HasSubstr("has not answered for 1 h 0 min"));
}

TEST_F(PageSiteTest, IsHealthyWhileTheServiceComesRound) {
  now += 9s;
  EXPECT_EQ(answer("/healthz").status, 200U);
  EXPECT_EQ(answer("/healthz").body, "ok\n");
  now += 1s;
  EXPECT_EQ(answer("/healthz").status, 503U);
  EXPECT_THAT(answer("/healthz").body, HasSubstr("has not come round for 10 s"));
  turn();
  EXPECT_EQ(answer("/healthz").status, 200U);
}

TEST_F(PageSiteTest, RefusesOtherNamesOfThisMachine) {
  for (const std::string target : {"/", "/metrics", "/api/status", "/style.css", "/campaigns/a"}) {
    EXPECT_EQ(answer(target, {.host = "evil.example"}).status, 403U) << target;
    EXPECT_EQ(answer(target, {}).status, 403U) << target;
  }
  EXPECT_EQ(answer("/healthz", {.host = "10.0.0.7:5557"}).status, 200U);  // A probe.
}

TEST_F(PageSiteTest, RefusesEverythingWithoutTheToken) {
  token = page_secret;
  for (const std::string& target :
       {std::string("/"), std::string("/metrics"), std::string("/api/status"),
        std::string("/style.css"), std::string("/campaigns/a"),
        std::string("/?token=another-secret-of-20"), "/workers?token=" + page_secret}) {
    EXPECT_EQ(answer(target).status, 401U) << target;
  }
  EXPECT_EQ(answer("/healthz").status, 200U);
  EXPECT_EQ(answer("/", {.host = "any.example", .authorization = "Bearer " + page_secret}).status,
            200U);
  EXPECT_EQ(answer("/?token=" + page_secret).status, 303U);
  EXPECT_EQ(answer("/?token=" + percent_encoded(page_secret)).status, 303U);
}

TEST_F(PageSiteTest, TellsProgramsTheStatus) {
  const json status = json_of("/api/status");
  EXPECT_EQ(status["api_version"], 1);
  EXPECT_EQ(status["campaigns"][0]["num_done"], 42);
  EXPECT_THAT(
      keys_of(status),
      UnorderedElementsAreArray({"api_version", "age_s", "version", "model_version", "uptime_s",
                                 "num_workers", "num_slots", "campaigns", "unserved_files",
                                 "num_unserved_files", "quarantined_hosts", "num_quarantined_hosts",
                                 "factories", "num_leases", "workers_by_state"}));
  EXPECT_THAT(keys_of(status["campaigns"][0]),
              UnorderedElementsAreArray(
                  {"name", "phase", "priority", "num_runs", "num_done", "num_without_estimate",
                   "num_given_up", "num_lent", "num_duplicates", "num_audited", "num_mismatches",
                   "rate_hz", "remaining_s", "storage_failure", "owner", "num_waiting"}));
}

TEST_F(PageSiteTest, TellsProgramsTheWorkersPageByPage) {
  const json third = json_of("/api/workers?page=3&sort=throughput");
  EXPECT_EQ(third["num_workers"], 120);
  EXPECT_EQ(third["num_pages"], 3);
  ASSERT_EQ(third["workers"].size(), 20U);
  EXPECT_EQ(third["workers"][19]["num_results"], 0);
  EXPECT_EQ(third["workers"][0]["num_results"], 19);
  EXPECT_EQ(third["workers"][0]["results_per_h"], 19.0);
  EXPECT_THAT(keys_of(third["workers"][0]),
              UnorderedElementsAreArray({"worker_id", "name", "host", "process_id", "num_slots",
                                         "num_lent", "num_results", "silent_s", "is_quarantined",
                                         "state", "registered_s", "results_per_h"}));
}

TEST_F(PageSiteTest, TellsProgramsOfOneCampaign) {
  const json campaign = json_of("/api/campaigns/a");
  EXPECT_EQ(campaign["campaign"]["num_runs"], 100);
  EXPECT_EQ(campaign["last_event_id"], 20);
  EXPECT_THAT(keys_of(campaign),
              UnorderedElementsAreArray({"api_version", "campaign", "details_age_s", "failure",
                                         "ends_without_estimate", "given_up", "losses", "accuracy",
                                         "last_event_id"}));
  EXPECT_TRUE(campaign["accuracy"].is_null());  // Nothing was read yet.
}

TEST_F(PageSiteTest, TellsProgramsTheAccuracySoFar) {
  details.results = std::make_shared<const CampaignResults>(
      CampaignResults{.json = R"([{"parameter":"a_c12","worst":0.25}])", .num_runs = 7});
  const json accuracy = json_of("/api/campaigns/a")["accuracy"];
  EXPECT_EQ(accuracy["num_runs"], 7);
  EXPECT_TRUE(accuracy["failure"].is_null());
  EXPECT_EQ(accuracy["parameters"][0]["worst"], 0.25);
  details.results = std::make_shared<const CampaignResults>(CampaignResults{.failure = "locked"});
  const json failed = json_of("/api/campaigns/a")["accuracy"];
  EXPECT_EQ(failed["failure"], "locked");
  EXPECT_TRUE(failed["parameters"].empty());
}

TEST_F(PageSiteTest, TellsProgramsTheEventsAfterOne) {
  const json all = json_of("/api/campaigns/a/events");
  EXPECT_EQ(all["events"].size(), 10U);
  EXPECT_EQ(all["next_after"], 20);
  const json some = json_of("/api/campaigns/a/events?after=18");
  ASSERT_EQ(some["events"].size(), 2U);
  EXPECT_EQ(some["events"][0]["event_id"], 19);
  const json none = json_of("/api/campaigns/a/events?after=20");
  EXPECT_TRUE(none["events"].empty());
  EXPECT_EQ(none["next_after"], 20);
  auto many = std::make_shared<CampaignEvents>();
  for (std::uint64_t id = 1; id <= 1500; ++id) many->events.push_back({.id = id});
  details.events = many;
  const json first = json_of("/api/campaigns/a/events");
  EXPECT_EQ(first["events"].size(), 1000U);
  EXPECT_EQ(first["next_after"], 1000);
  EXPECT_EQ(first["num_left"], 500);
}

TEST_F(PageSiteTest, WaitsForADatabaseIfAProgramAsks) {
  details = {};
  const HttpRequest request{.target = "/api/campaigns/a", .host = "localhost"};
  (void)answer("/");
  EXPECT_FALSE(site().answer(request, HttpServer::Patience::left).has_value());
  EXPECT_EQ(site().answer(request, HttpServer::Patience::over)->status, 200U);
  EXPECT_EQ(answer("/api/campaigns/a/events").status, 503U);
  EXPECT_EQ(answer("/campaigns/a").status, 200U);
}

}  // namespace
}  // namespace proofmass::coordinator
