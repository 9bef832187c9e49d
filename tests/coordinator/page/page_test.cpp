#include "coordinator/page/page.hpp"

#include <regex>

#include "tests/coordinator/net/service_fixture.hpp"
#include "tests/coordinator/page/page_fixture.hpp"
#include "tests/coordinator/page/raw_client.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

using test::page_secret;

class SnapshotBoardTest : public ::testing::Test {
 protected:
  void turn() {
    board.on_turn(now, [this] {
      ++num_taken;
      return ServiceSnapshot{};
    });
  }
  auto want() { return board.want(now); }

  TimePoint now{1000s};
  SnapshotBoard board{now};
  int num_taken = 0;
};

TEST_F(SnapshotBoardTest, CostsNothingWhileNobodyAsks) {
  for (int i = 0; i < 100; ++i) {
    now += 100ms;
    turn();
  }
  EXPECT_EQ(num_taken, 0);
}

TEST_F(SnapshotBoardTest, HasASnapshotAfterTheNextTurn) {
  EXPECT_EQ(want(), nullptr);
  turn();
  const auto snapshot = want();
  ASSERT_NE(snapshot, nullptr);
  EXPECT_EQ(snapshot->taken_at, now);
}

TEST_F(SnapshotBoardTest, TakesOneASecondForHalfAMinute) {
  (void)want();
  for (int i = 0; i < 600; ++i) {
    turn();
    now += 100ms;
  }
  EXPECT_EQ(num_taken, 30);
}

TEST_F(SnapshotBoardTest, TellsHowLongTheServiceHasNotComeRound) {
  now += 3s;
  EXPECT_EQ(board.since_turn(now), 3s);
  turn();
  now += 1s;
  EXPECT_EQ(board.since_turn(now), 1s);
}

/// A metric as a reader of the format sees it.
struct ReadMetric {
  std::string kind;
  std::map<std::string, double> samples;  ///< By labels, as they are written.
};

/// Reads Prometheus' text format 0.0.4, and fails on anything that its rules do not allow.
std::map<std::string, ReadMetric> read_metrics(const std::string& text) {
  static const std::regex help("# HELP ([a-zA-Z_:][a-zA-Z0-9_:]*) (.+)");
  static const std::regex type("# TYPE ([a-zA-Z_:][a-zA-Z0-9_:]*) (counter|gauge)");
  static const std::string label = R"re([a-zA-Z_]+="(?:[^"\\\n]|\\\\|\\"|\\n)*")re";
  static const std::regex sample("([a-zA-Z_:][a-zA-Z0-9_:]*)(\\{" + label + "(?:," + label +
                                 ")*\\})?"
                                 " (-?[0-9.]+(?:e[+-]?[0-9]+)?)");
  EXPECT_TRUE(text.ends_with('\n'));
  std::map<std::string, ReadMetric> metrics;
  std::istringstream lines(text);
  std::string line, helped, typed;
  while (std::getline(lines, line)) {
    std::smatch match;
    if (std::regex_match(line, match, help)) {
      helped = match[1];
      EXPECT_FALSE(metrics.contains(helped)) << helped << " comes twice";
    } else if (std::regex_match(line, match, type)) {
      typed = match[1];
      EXPECT_EQ(typed, helped);
      metrics[typed].kind = match[2];
    } else if (std::regex_match(line, match, sample)) {
      EXPECT_EQ(match[1], typed) << line;
      EXPECT_TRUE(metrics[typed].samples.emplace(match[2], std::stod(match[3])).second) << line;
    } else {
      ADD_FAILURE() << "no line of the format: " << line;
    }
  }
  return metrics;
}

std::string text_of(const ServiceSnapshot& snapshot) {
  return metrics_text(snapshot, snapshot.taken_at, {});
}

TEST(Metrics, TellWhatIsKnownOfEachCampaign) {
  ServiceSnapshot snapshot;
  snapshot.campaigns = {test::campaign_snapshot("a", 42, 100),
                        test::campaign_snapshot("b", 1'000'000, 12'345'678)};
  snapshot.campaigns[1].status.set_storage_failure("disk");
  snapshot.campaigns[1].num_waiting = 7;
  const auto metrics = read_metrics(text_of(snapshot));
  EXPECT_EQ(metrics.at("proofmass_runs_finished_total").samples.at("{campaign=\"a\"}"), 42.0);
  EXPECT_EQ(metrics.at("proofmass_runs_finished_total").samples.at("{campaign=\"b\"}"), 1e6);
  EXPECT_EQ(metrics.at("proofmass_runs_wanted").samples.at("{campaign=\"b\"}"), 12'345'678.0);
  EXPECT_EQ(metrics.at("proofmass_storage_failed").samples.at("{campaign=\"b\"}"), 1.0);
  EXPECT_EQ(metrics.at("proofmass_storage_failed").samples.at("{campaign=\"a\"}"), 0.0);
  EXPECT_EQ(metrics.at("proofmass_results_waiting").samples.at("{campaign=\"b\"}"), 7.0);
  EXPECT_EQ(metrics.at("proofmass_campaigns").samples.at("{phase=\"active\"}"), 2.0);
}

TEST(Metrics, AreCountersIfTheirNamesSaySo) {
  ServiceSnapshot snapshot;
  snapshot.campaigns = {test::campaign_snapshot("a", 42, 100)};
  for (const auto& [name, metric] : read_metrics(text_of(snapshot))) {
    EXPECT_EQ(metric.kind == "counter", name.ends_with("_total")) << name;
    EXPECT_FALSE(metric.samples.empty()) << name;
  }
}

TEST(Metrics, CountWorkersByState) {
  ServiceSnapshot snapshot;
  snapshot.num_workers_by_activity = {5, 4, 3, 2};
  const ReadMetric workers = read_metrics(text_of(snapshot)).at("proofmass_workers");
  EXPECT_EQ(workers.samples.at("{state=\"computing\"}"), 5.0);
  EXPECT_EQ(workers.samples.at("{state=\"idle\"}"), 4.0);
  EXPECT_EQ(workers.samples.at("{state=\"silent\"}"), 3.0);
  EXPECT_EQ(workers.samples.at("{state=\"quarantined\"}"), 2.0);
}

TEST(Metrics, EscapeLabels) {
  EXPECT_EQ(label_value("a\\b\"c\nd"), "a\\\\b\\\"c\\nd");
  EXPECT_EQ(label_value("é\xff"), "é\uFFFD");
  ServiceSnapshot snapshot;
  snapshot.campaigns = {test::campaign_snapshot(test::hostile_name, 1, 2)};
  EXPECT_EQ(read_metrics(text_of(snapshot)).at("proofmass_runs_finished_total").samples.size(), 1U);
}

// Those that may still change must not be left out for finished ones.
TEST(Metrics, LeaveOutCampaignsBeyondABound) {
  ServiceSnapshot snapshot;
  snapshot.campaigns.push_back(test::campaign_snapshot("active", 1, 2));
  for (int i = 0; i < 250; ++i) {
    snapshot.campaigns.push_back(test::campaign_snapshot("c" + std::to_string(i), 2, 2));
    snapshot.campaigns.back().status.set_phase(proto::CAMPAIGN_PHASE_FINISHED);
  }
  const auto metrics = read_metrics(text_of(snapshot));
  const auto& finished = metrics.at("proofmass_runs_finished_total").samples;
  EXPECT_EQ(finished.size(), campaigns_with_metrics_max);
  EXPECT_TRUE(finished.contains("{campaign=\"active\"}"));
  EXPECT_TRUE(finished.contains("{campaign=\"c249\"}"));
  EXPECT_EQ(metrics.at("proofmass_campaigns_left_out").samples.at(""), 51.0);
  EXPECT_EQ(metrics.at("proofmass_campaigns").samples.at("{phase=\"finished\"}"), 250.0);
}

TEST(Metrics, HaveFiguresOfThisProcess) {
  const auto value_of = [](const std::string& name) {
    return read_metrics(text_of({})).at(name).samples.at("");
  };
  const double cpu_s = value_of("process_cpu_seconds_total");
  const double num_open = value_of("process_open_fds");
  EXPECT_GT(value_of("process_resident_memory_bytes"), 1e6);
  EXPECT_GT(value_of("process_virtual_memory_bytes"), value_of("process_resident_memory_bytes"));
  EXPECT_GE(value_of("process_max_fds"), num_open);
  const double now_s =
      std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
  // Tests do not take hours.
  EXPECT_NEAR(value_of("process_start_time_seconds"), now_s, 3600.0);
  const int further = ::dup(1);
  EXPECT_EQ(value_of("process_open_fds"), num_open + 1.0);
  ::close(further);
  EXPECT_GE(value_of("process_cpu_seconds_total"), cpu_s);
}

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

const wire::Log no_log = [](const wire::Event&) {};

/// A page of a real service.
class PageOfServiceTest : public test::ServiceTest {
 protected:
  /// The answer, while the service comes round.
  std::string answer(Page& page, const std::string& target) {
    const std::string url = page.url();
    const auto port = static_cast<std::uint16_t>(std::stoul(url.substr(url.rfind(':') + 1)));
    std::future<std::string> given = std::async(
        std::launch::async, [port, target] { return test::RawClient(port).ask(target); });
    while (given.wait_for(std::chrono::milliseconds(1)) != std::future_status::ready) {
      in_service([&] { page.on_turn(*service); });
    }
    return given.get();
  }
  static PageConfig on_loopback() { return {.address = "127.0.0.1:0"}; }
};

TEST_F(PageOfServiceTest, ShowsTheCampaignsAndWorkersOfNow) {
  start({test::campaign_of("a", 10), test::campaign_of("b", 20)});
  Page page(on_loopback(), no_log);
  EXPECT_THAT(answer(page, "/"), HasSubstr(">a</a>"));
  EXPECT_THAT(answer(page, "/metrics"),
              AllOf(HasSubstr("proofmass_runs_wanted{campaign=\"a\"} 10\n"),
                    HasSubstr("proofmass_runs_wanted{campaign=\"b\"} 20\n"),
                    HasSubstr("proofmass_workers{state=\"idle\"} 0\n")));
}

TEST_F(PageOfServiceTest, ReadsTheDatabaseOfACampaign) {
  start({test::campaign_of("a", 10)});
  Page page(on_loopback(), no_log);
  in_service([&] { (void)service->campaigns(); });
  std::string shown;
  while (shown.find("<h2>Events</h2>") == std::string::npos) shown = answer(page, "/campaigns/a");
  // The definition that the fixture stores is none.
  EXPECT_THAT(shown, HasSubstr("cannot be read now: stored definition:1: "));
}

TEST_F(PageOfServiceTest, ForbidsTheBrowserWhatItDoesNotNeed) {
  start({test::campaign_of("a", 10)});
  Page page(on_loopback(), no_log);
  for (const std::string target : {"/", "/script.js", "/nothing", "/metrics"}) {
    const std::string given = answer(page, target);
    EXPECT_THAT(given, HasSubstr("Content-Security-Policy: default-src 'none'; ")) << target;
    EXPECT_THAT(given, HasSubstr("X-Content-Type-Options: nosniff\r\n")) << target;
    EXPECT_THAT(given, HasSubstr("Referrer-Policy: no-referrer\r\n")) << target;
    EXPECT_THAT(given, HasSubstr("Cache-Control: no-store\r\n")) << target;
  }
}

TEST(PageBeyondLoopback, WarnsThatNothingIsEncryptedWithoutTellingTheToken) {
  const test::ScratchDirectory directory;
  const auto file = directory / "token";
  std::ofstream(file) << test::page_secret;
  std::filesystem::permissions(file, std::filesystem::perms::owner_read);
  std::vector<std::string> lines;
  const Page page({.address = "*:0", .token_file = file},
                  [&](const wire::Event& event) { lines.push_back(to_text(event)); });
  ASSERT_EQ(lines.size(), 2U);
  EXPECT_THAT(lines[0], StartsWith("page_served url=http://0.0.0.0:"));
  EXPECT_THAT(lines[1], StartsWith("page_not_encrypted url="));
  for (const std::string& line : lines) {
    EXPECT_THAT(line, testing::Not(HasSubstr(test::page_secret)));
  }
}

}  // namespace
}  // namespace proofmass::coordinator
