#include "coordinator/page/page.hpp"
#include "tests/coordinator/page/page_fixture.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

using test::page_secret;

class PageSiteTest : public ::testing::Test {
 protected:
  PageSiteTest() {
    service.campaigns = {test::campaign_snapshot("a", 42, 100),
                         test::campaign_snapshot(test::hostile_name, 1, 2)};
    service.workers = test::many_workers(120);
    auto read = std::make_shared<CampaignDetails>();
    for (std::uint64_t id = 11; id <= 20; ++id) read->events.push_back({.id = id, .kind = "e"});
    details = read;
    turn();
  }
  void turn() {
    board.on_turn(now, [this] { return service; });
  }
  [[nodiscard]] PageSite site() {
    return PageSite({.access = token ? PageAccess(*token) : PageAccess(),
                     .board = &board,
                     .details =
                         [this](const CampaignRecord& campaign, TimePoint) {
                           asked_for = campaign.status.name() + " " + campaign.file.string();
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

  TimePoint now{1000s};
  SnapshotBoard board{now};
  ServiceSnapshot service;
  std::shared_ptr<const CampaignDetails> details;
  std::optional<std::string> token;
  std::string asked_for;
};

TEST_F(PageSiteTest, HasAnAnswerAtEachAddress) {
  for (const std::string target : {"/", "/?page=1", "/workers", "/campaigns/a", "/style.css",
                                   "/script.js", "/metrics", "/healthz"}) {
    EXPECT_EQ(answer(target).status, 200U) << target;
  }
}

TEST_F(PageSiteTest, HasNothingElsewhere) {
  for (const std::string target :
       {"/index.html", "/campaigns", "/campaigns/b", "/campaigns/a/x", "/campaigns/a/events",
        "/campaigns/../a", "/campaigns/%2e%2e", "/../etc/passwd", "/%2e%2e/%2e%2e/etc/passwd",
        "/metrics/x", "/x/script.js", "/workers/x", "//", "/a.db", "", "x"}) {
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
  for (const std::string target : {"/", "/metrics", "/style.css", "/campaigns/a"}) {
    EXPECT_EQ(answer(target, {.host = "evil.example"}).status, 403U) << target;
    EXPECT_EQ(answer(target, {}).status, 403U) << target;
  }
  EXPECT_EQ(answer("/healthz", {.host = "10.0.0.7:5557"}).status, 200U);  // A probe.
}

TEST_F(PageSiteTest, RefusesEverythingWithoutTheToken) {
  token = page_secret;
  for (const std::string& target :
       {std::string("/"), std::string("/metrics"), std::string("/style.css"),
        std::string("/campaigns/a"), std::string("/?token=another-secret-of-20"),
        "/workers?token=" + page_secret}) {
    EXPECT_EQ(answer(target).status, 401U) << target;
  }
  EXPECT_EQ(answer("/healthz").status, 200U);
  EXPECT_EQ(answer("/", {.host = "any.example", .authorization = "Bearer " + page_secret}).status,
            200U);
  EXPECT_EQ(answer("/?token=" + page_secret).status, 303U);
  EXPECT_EQ(answer("/?token=" + percent_encoded(page_secret)).status, 303U);
}

}  // namespace
}  // namespace proofmass::coordinator
