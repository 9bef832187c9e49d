#include "coordinator/page/page_views.hpp"

#include "tests/coordinator/page/page_fixture.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

using test::campaign_snapshot;
using test::hostile_name;
using test::worker_snapshot;

/// All that a page has, as if it were one.
std::string text_of(const PageContent& content) { return whole_page(content); }

/// Nothing that a browser could take for markup or a script, and no control character.
void expect_harmless(const std::string& html) {
  EXPECT_THAT(html, Not(HasSubstr("<script>alert")));
  EXPECT_THAT(html, Not(HasSubstr("\x1b")));
  EXPECT_THAT(html, Not(HasSubstr("\xff")));
  EXPECT_THAT(html, Not(HasSubstr("alert(\"1\")")));
}

TEST(PageOfList, IsWithinTheList) {
  const PageOfList second = page_of_list(2, 120);
  EXPECT_EQ(second.first, 50U);
  EXPECT_EQ(second.end, 100U);
  EXPECT_EQ(second.num_pages, 3U);
  EXPECT_EQ(page_of_list(99, 120).page, 3U);
  EXPECT_EQ(page_of_list(99, 120).end, 120U);
  EXPECT_EQ(page_of_list(0, 120).page, 1U);
  EXPECT_EQ(page_of_list(1, 0).num_pages, 1U);
  EXPECT_EQ(page_of_list(1, 0).end, 0U);
}

TEST(ListNavigation, SaysWhatIsShownOfAll) {
  EXPECT_THAT(list_navigation(page_of_list(1, 10'000), "workers", "workers?page="),
              HasSubstr("showing 1–50 of 10,000 workers"));
  const std::string last = list_navigation(page_of_list(200, 10'000), "workers", "workers?page=");
  EXPECT_THAT(last, HasSubstr("showing 9,951–10,000 of 10,000 workers"));
  EXPECT_THAT(last, HasSubstr("<a href=\"workers?page=199\">previous</a>"));
  EXPECT_THAT(last, HasSubstr("<span class=\"off\">next</span>"));
  EXPECT_THAT(list_navigation(page_of_list(1, 0), "workers", ""), HasSubstr("no workers"));
}

TEST(GroupedNumber, HasACommaEveryThreeDigits) {
  EXPECT_EQ(grouped(0), "0");
  EXPECT_EQ(grouped(999), "999");
  EXPECT_EQ(grouped(1000), "1,000");
  EXPECT_EQ(grouped(1234567), "1,234,567");
}

TEST(OverviewPage, ShowsEachCampaign) {
  ServiceSnapshot snapshot;
  snapshot.campaigns = {campaign_snapshot("hardy2013", 42, 100)};
  snapshot.campaigns[0].status.set_rate_hz(0.5);
  snapshot.campaigns[0].status.set_remaining_s(116.0);
  const std::string html = overview_page(snapshot, {}, {}).live;
  EXPECT_THAT(html, HasSubstr("<a href=\"campaigns/hardy2013\">hardy2013</a>"));
  EXPECT_THAT(html, HasSubstr("<progress max=\"100\" value=\"42\""));
  EXPECT_THAT(html, HasSubstr("42&nbsp;%"));
  EXPECT_THAT(html, HasSubstr("<td>0.500</td><td>1 min 56 s</td>"));
}

TEST(OverviewPage, ShowsFiftyCampaignsAtATime) {
  ServiceSnapshot snapshot;
  for (int i = 0; i < 60; ++i) {
    snapshot.campaigns.push_back(campaign_snapshot("c" + std::to_string(i), 0, 1));
  }
  const std::string second = overview_page(snapshot, *parse_target("/?page=2"), {}).live;
  EXPECT_THAT(second, HasSubstr(">c50</a>"));
  EXPECT_THAT(second, Not(HasSubstr(">c49</a>")));
  EXPECT_THAT(second, HasSubstr("showing 51–60 of 60 campaigns"));
}

TEST(OverviewPage, SaysWhenTheCoordinatorIsSilent) {
  const ServiceSnapshot snapshot{.taken_at = TimePoint{}};
  const auto html_after = [&](std::chrono::seconds age) {
    return overview_page(snapshot, {}, TimePoint{} + age).live;
  };
  EXPECT_THAT(html_after(std::chrono::seconds(5)), Not(HasSubstr("has not answered")));
  EXPECT_THAT(html_after(std::chrono::seconds(12)), HasSubstr("has not answered for 12 s"));
}

TEST(Pages, ShowHostileTextAsText) {
  ServiceSnapshot snapshot;
  snapshot.campaigns = {campaign_snapshot(hostile_name, 1, 2)};
  snapshot.campaigns[0].status.set_owner(hostile_name);
  snapshot.campaigns[0].status.set_storage_failure(hostile_name);
  snapshot.status.add_unserved_files()->set_file(hostile_name);
  snapshot.status.mutable_unserved_files(0)->set_reason(hostile_name);
  snapshot.status.set_num_unserved_files(1);
  snapshot.workers = {worker_snapshot(hostile_name, 1)};
  snapshot.workers[0].status.set_cards(hostile_name);
  expect_harmless(text_of(overview_page(snapshot, {}, {})));
  expect_harmless(text_of(workers_page(
      snapshot, *parse_target("/workers?filter=" + percent_encoded(hostile_name)), {})));

  CampaignDetails details;
  details.events.push_back(
      {.id = 1, .time_utc = hostile_name, .kind = hostile_name, .text = hostile_name});
  details.losses = {{.reason = hostile_name, .num_losses = 1, .num_runs = 2, .num_blamed = 0}};
  details.ends = {{.status = hostile_name, .cause = hostile_name, .session = hostile_name}};
  details.given_up = {{.run = {3}, .reason = hostile_name, .given_up_utc = hostile_name}};
  details.attempts.computed = {{.worker_key = 1, .worker = hostile_name, .unix_s = 1000}};
  details.attempts.lost = {{.worker_key = 1, .worker = hostile_name, .reason = hostile_name}};
  details.failure = hostile_name;
  const std::string html = text_of(campaign_page(snapshot.campaigns[0], &details, {}, TimePoint{}));
  expect_harmless(html);
  EXPECT_THAT(html, HasSubstr("&lt;script&gt;"));
}

TEST(ChosenWorkers, AreThoseOfOnePageInOrder) {
  const std::vector<RegisteredWorker> workers = test::many_workers(120);
  const ChosenWorkers second = choose_workers(workers, {.page = 2});
  ASSERT_EQ(second.workers.size(), 50U);
  EXPECT_EQ(second.workers.front()->status.name(), "w00050");
  EXPECT_EQ(second.workers.back()->status.name(), "w00099");
  EXPECT_EQ(choose_workers(workers, {.page = 3}).workers.size(), 20U);
}

// Sorting only what is shown must give the same as sorting all.
TEST(ChosenWorkers, HaveEachWorkerOnceOverAllPages) {
  std::vector<RegisteredWorker> workers = test::many_workers(333);
  std::mt19937 random(1);
  std::shuffle(workers.begin(), workers.end(), random);
  for (RegisteredWorker& worker : workers) {
    worker.activity = worker_activities[worker.status.worker_id() % worker_activities.size()];
  }
  for (const WorkerOrder order : {WorkerOrder::name, WorkerOrder::state, WorkerOrder::throughput}) {
    std::set<std::string> names;
    for (std::size_t page = 1; page <= 7; ++page) {
      for (const auto* worker : choose_workers(workers, {.order = order, .page = page}).workers) {
        names.insert(worker->status.name());
      }
    }
    EXPECT_EQ(names.size(), 333U) << static_cast<int>(order);
  }
}

TEST(WorkersPage, GroupsTheDigitsOfRates) {
  ServiceSnapshot snapshot{.workers = test::many_workers(1)};
  snapshot.workers[0].status.set_num_results(4000);
  snapshot.workers[0].registered_s = 7200.0;
  EXPECT_THAT(workers_page(snapshot, {}, {}).live, HasSubstr("<td>4,000</td><td>2,000</td>"));
}

TEST(ChosenWorkers, AreSortedByStateAndThroughput) {
  std::vector<RegisteredWorker> workers = test::many_workers(4);
  workers[2].activity = WorkerActivity::quarantined;
  workers[0].activity = WorkerActivity::silent;
  workers[3].activity = WorkerActivity::computing;
  const auto names = [&](WorkerOrder order) {
    std::string text;
    for (const auto* worker : choose_workers(workers, {.order = order}).workers) {
      text += worker->status.name().back();
    }
    return text;
  };
  EXPECT_EQ(names(WorkerOrder::state), "2031");
  EXPECT_EQ(names(WorkerOrder::throughput), "3210");
}

TEST(ChosenWorkers, CanBeThoseWithANameOrHost) {
  const std::vector<RegisteredWorker> workers = test::many_workers(1000);
  EXPECT_EQ(choose_workers(workers, {.filter = "w0099"}).list.count, 10U);
  EXPECT_EQ(choose_workers(workers, {.filter = "host-w00001"}).list.count, 1U);
  EXPECT_EQ(choose_workers(workers, {.filter = "nobody"}).list.count, 0U);
}

TEST(CampaignPage, ShowsTheNewestEventsPageByPage) {
  CampaignDetails details;
  for (std::uint64_t id = 1; id <= 300; ++id) {
    details.events.push_back({.id = id, .time_utc = "t", .kind = "e" + std::to_string(id)});
  }
  const auto page = [&](const std::string& target) {
    return campaign_page(campaign_snapshot("a", 1, 2), &details, *parse_target(target), {}).live;
  };
  EXPECT_THAT(page("/"), HasSubstr("<td class=\"words\">e300</td>"));
  EXPECT_THAT(page("/"), Not(HasSubstr("<td class=\"words\">e250</td>")));
  EXPECT_THAT(page("/?events=2"), HasSubstr("<td class=\"words\">e250</td>"));
  EXPECT_THAT(page("/?events=4"), HasSubstr("showing 151–200 of 200 events"));
  EXPECT_THAT(page("/"), HasSubstr("100 older events"));
}

TEST(CampaignPage, SaysWhatIsStillBeingRead) {
  const std::string html = campaign_page(campaign_snapshot("a", 1, 2), {}, {}, {}).live;
  EXPECT_THAT(html, HasSubstr("The database is being read."));
}

TEST(WholePage, HasRelativeAddressesOnly) {
  const std::string root = whole_page({.title = "a", .live = "x"});
  EXPECT_THAT(root, HasSubstr("href=\"./style.css\""));
  const std::string below = whole_page({.title = "a", .to_root = "../", .live = "x"});
  EXPECT_THAT(below, HasSubstr("href=\"../style.css\""));
  EXPECT_THAT(below, HasSubstr("src=\"../script.js\""));
  for (const std::string& html : {root, below}) {
    EXPECT_THAT(html, Not(HasSubstr("=\"/")));
    EXPECT_THAT(html, Not(HasSubstr("//")));
  }
}

RecentAttempt computed(std::uint64_t run, std::uint64_t worker, double compute_s,
                       std::uint64_t received) {
  return {.worker_key = worker,
          .worker = worker == 1 ? "a" : "b",
          .first = {run},
          .last = {run},
          .attempt = {1},
          .compute_s = compute_s,
          .unix_s = received};
}

/// Of two workers, with up to three threads each.
RecentAttempts random_attempts(unsigned seed, double compute_s_max) {
  std::mt19937 random(seed);
  RecentAttempts attempts;
  std::uint64_t received = 2'000'000'000;
  for (std::uint64_t run = 0; run < 200; ++run) {
    received -= random() % 2;
    const double compute_s = compute_s_max * static_cast<double>(random() % 1000 + 1) / 1000.0;
    attempts.computed.push_back(computed(run, random() % 2 + 1, compute_s, received));
  }
  return attempts;
}

TEST(AttemptLanes, HoldEachAttemptOnceWithoutOverlap) {
  constexpr double last_s = 2e9;
  for (const double compute_s_max : {0.05, 3.0, 40.0}) {
    const RecentAttempts attempts = random_attempts(1, compute_s_max);
    std::set<std::size_t> runs;
    std::string worker;
    for (const TimelineLane& lane : lanes_of(attempts, last_s)) {
      if (!lane.label.empty()) worker = lane.label;
      double free_until = 1e300;
      for (const TimelineBar& bar : lane.bars) {
        const std::size_t run = std::stoul(bar.tooltip.substr(std::string("run ").size()));
        EXPECT_TRUE(runs.insert(run).second) << run;
        EXPECT_EQ(attempts.computed.at(run).worker_key, worker == "a" ? 1U : 2U);
        EXPECT_LE(bar.end, free_until);
        free_until = bar.begin;
        const double received = static_cast<double>(attempts.computed[run].unix_s) - last_s;
        EXPECT_LE(bar.end, received);
        EXPECT_GE(bar.end, received - 1.0);
      }
    }
    EXPECT_EQ(runs.size(), attempts.computed.size());
  }
}

// One thread computes one batch after the other, and its results come in whole seconds.
TEST(AttemptLanes, AreOneForOneThread) {
  RecentAttempts attempts;
  for (int i = 50; i > 0; --i) {
    attempts.computed.push_back(computed(static_cast<std::uint64_t>(i), 1, 1.5,
                                         static_cast<std::uint64_t>(1000.0 + 1.5 * i)));
  }
  EXPECT_EQ(lanes_of(attempts, 0.0).size(), 1U);
}

TEST(AttemptsChart, SaysHowManyLanesItLeavesOut) {
  RecentAttempts attempts;
  for (std::uint64_t worker = 1; worker <= 30; ++worker) {
    attempts.computed.push_back(computed(worker, worker, 1.0, 1000));
  }
  EXPECT_THAT(attempts_chart(attempts), HasSubstr("showing 24 of 30 lanes"));
  EXPECT_THAT(attempts_chart({}), HasSubstr("none yet"));
}

}  // namespace
}  // namespace proofmass::coordinator
