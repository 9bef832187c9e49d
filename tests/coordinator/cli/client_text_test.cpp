#include <fmt/format.h>

#include "coordinator/cli/client.hpp"
#include "core/runs.hpp"
#include "tests/proto/wire/requests.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

proto::CampaignStatus campaign(const std::string& name, std::uint64_t num_done) {
  return test::campaign_status(name, num_done, 100);
}

proto::StatusReply status_with(const std::vector<proto::CampaignStatus>& campaigns) {
  proto::StatusReply status = test::status_with(campaigns);
  status.set_version("0.1.0");
  status.set_model_version("hardy2013-2");
  status.set_uptime_s(12000.0);
  status.set_num_workers(12);
  status.set_num_slots(48);
  return status;
}

void add_unserved(const std::string& file, const std::string& reason, proto::StatusReply& status) {
  proto::UnservedFile& unserved = *status.add_unserved_files();
  unserved.set_file(file);
  unserved.set_reason(reason);
}

proto::WorkerStatus worker(std::uint64_t id, const std::string& name) {
  proto::WorkerStatus status = test::worker_status(id, name, fmt::format("n{}", id));
  status.set_process_id(4711);
  status.set_num_slots(4);
  status.set_num_lent(64);
  status.set_num_results(1234);
  status.set_silent_s(2.9);
  return status;
}

void expect_width_at_most(const std::string& text, std::size_t width) {
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) EXPECT_LE(display_width(line), width) << line;
}

TEST(StatusTable, ShowsFilesThatAreNotServedAndHostsInQuarantine) {
  proto::StatusReply status = status_with({campaign("a", 1)});
  status.set_num_campaigns(3);
  add_unserved("d/b.db", "campaign database = d/b.db (is locked)", status);
  status.set_num_unserved_files(2);
  status.add_quarantined_hosts("n7");
  status.set_num_quarantined_hosts(1);
  const std::string text = status_text(status, {.line_width_max = 79});
  EXPECT_TRUE(
      text.ends_with("and 2 more campaigns\n"
                     "not served, tried again: campaign database = d/b.db (is locked)\n"
                     "and 1 more such file\n"
                     "host n7 is in quarantine: too many workers crashed there; "
                     "`proofmass release n7\n  --connect ADDRESS`\n"))
      << text;
}

TEST(StatusTable, TellsOfRefusedWorkersAndTheLastReason) {
  proto::StatusReply status = status_with({campaign("a", 1)});
  status.set_num_refusals(3);
  status.set_last_refusal("n7-12: host = n7 (too much crashed there)");
  status.set_last_refusal_s(200.0);
  const std::string text = status_text(status, {.line_width_max = 120});
  EXPECT_TRUE(
      text.ends_with("\n3 workers refused; the last 3 min 20 s ago: n7-12: host = n7 (too "
                     "much crashed there)\n"))
      << text;
}

// A file that somebody made may have any name of a campaign in it, and the reason may quote it.
TEST(StatusTable, ShowsAReasonInOneLine) {
  proto::StatusReply status = status_with({campaign("a", 1)});
  status.mutable_campaigns(0)->set_storage_failure("full\nb: all is well");
  add_unserved("d/b.db", "d/b.db: campaign b\nc \x1b[2J", status);
  const std::string text = status_text(status, {.line_width_max = 79});
  EXPECT_TRUE(
      text.ends_with("a: nothing can be stored: full\\nb: all is well\n"
                     "not served, tried again: d/b.db: campaign b\\nc \\u001b[2J\n"))
      << text;
}

proto::WorkersReply reply_of(const std::vector<proto::WorkerStatus>& workers) {
  return test::reply_with(workers).workers();
}

proto::FactoryStatus factory(proto::FactoryPhase phase, double wait_s, const std::string& reason) {
  proto::FactoryStatus status;
  proto::FactoryReport& report = *status.mutable_report();
  report = test::factory_report("fleet", 30, phase);
  report.set_num_wanted(3);
  report.set_num_registered(2);
  report.set_num_queued(1);
  report.set_wait_s(wait_s);
  report.set_reason(reason);
  status.set_owner("anna");
  status.set_silent_s(12.0);
  return status;
}

TEST(StatusTable, ShowsFactoriesAndWhyTheyDoNotSubmit) {
  proto::StatusReply status = status_with({});
  *status.add_factories() = factory(proto::FACTORY_PHASE_ACTIVE, 0.0, "");
  *status.add_factories() =
      factory(proto::FACTORY_PHASE_WAITING, 60.0, "submission: qsub: queue\nfull");
  *status.add_factories() = factory(proto::FACTORY_PHASE_WAITING, 5.0, "late");
  *status.add_factories() =
      factory(proto::FACTORY_PHASE_PAUSED, 0.0, "3 workers in a row did not start");
  const std::string counts = ": 3 workers wanted, 2 registered, 1 in the queue";
  const std::string text = status_text(status, {.line_width_max = 79});
  EXPECT_TRUE(
      text.ends_with("no campaigns\n"
                     "factory fleet (pbs) active" +
                     counts + "\nfactory fleet (pbs) waiting" + counts +
                     ";\n  tries again in 48 s; submission: qsub: queue\\nfull\n"
                     "factory fleet (pbs) waiting" +
                     counts + ";\n  tries again in 0 s; late\nfactory fleet (pbs) paused" + counts +
                     "; 3\n  workers in a row did not start\n"))
      << text;
}

TEST(StatusTable, ShowsCampaignsAndWhatIsOutOfTheOrdinary) {
  proto::CampaignStatus first = campaign("hardy2013", 42);
  first.set_rate_hz(12.34);
  first.set_remaining_s(200.0);
  first.set_num_lent(16);
  proto::CampaignStatus second = campaign("second-order", 97);
  second.set_phase(proto::CAMPAIGN_PHASE_PAUSED);
  second.set_priority(-5);
  second.set_num_suspects(1);
  second.set_num_given_up(1);
  second.set_num_without_estimate(2);
  second.set_num_audited(10);
  second.set_num_mismatches(3);
  EXPECT_EQ(status_text(status_with({first, second}), {.line_width_max = 79}),
            R"(Proofmass 0.1.0, model hardy2013-2, up 3 h 20 min
12 workers with 48 slots, 16 runs lent

campaign         phase      prio       done       runs    %  runs/s   time left
───────────────────────────────────────────────────────────────────────────────
hardy2013        active        0         42        100   42    12.3  3 min 20 s
second-order     paused       -5         97        100   97       -           -
second-order: 1 run given up: crashed too often
second-order: 1 run crashed: tried again last, alone
second-order: 2 runs without an estimate
second-order: 10 results compared with a second computation: 3 differ (none may)
)");
}

TEST(StatusTable, NamesTheModelsOfTheCampaigns) {
  const auto first_line = [](const proto::StatusReply& status) {
    const std::string text = status_text(status, {.line_width_max = 79});
    return text.substr(0, text.find('\n'));
  };
  proto::CampaignStatus ruler = campaign("a", 1), scale = campaign("b", 1);
  ruler.set_model_version("ruler-1");
  scale.set_model_version("balance-3");

  EXPECT_EQ(first_line(status_with({ruler, ruler})),
            "Proofmass 0.1.0, model ruler-1, up 3 h 20 min");
  EXPECT_EQ(first_line(status_with({ruler, scale})),
            "Proofmass 0.1.0, models balance-3, ruler-1, up 3 h 20 min");
  EXPECT_EQ(first_line(status_with({})), "Proofmass 0.1.0, model hardy2013-2, up 3 h 20 min");
  scale.set_model_version("hardy2013-1");  // Of an older program, and finished.
  EXPECT_EQ(first_line(status_with({scale})), "Proofmass 0.1.0, model hardy2013-2, up 3 h 20 min");
}

TEST(StatusTable, GivesALongNameTheRoomThatTheLineHas) {
  const std::string name(30, 'x');
  const proto::StatusReply status = status_with({campaign(name, 1), campaign("b", 1)});
  const std::string text = status_text(status, {.line_width_max = 200});
  EXPECT_NE(text.find("\n" + name + " active "), std::string::npos) << text;
  EXPECT_NE(text.find("\nb" + std::string(30, ' ') + "active "), std::string::npos) << text;
  expect_width_at_most(status_text(status, {.line_width_max = 85}), 85);
  EXPECT_NE(status_text(status, {.line_width_max = 85}).find("\nxxxxxxxxxxxxxxxxxxxxx… active "),
            std::string::npos);
}

TEST(StatusTable, MarksTroubleAndNothingElse) {
  proto::CampaignStatus status = campaign("mine", 1);
  status.set_storage_failure("disk full");
  status.set_num_given_up(2);
  status.set_num_without_estimate(3);
  status.set_num_audited(1);
  status.set_num_mismatches(1);
  proto::StatusReply reply = status_with({status});
  add_unserved("b.db", "is damaged", reply);
  reply.add_quarantined_hosts("node7");
  const std::string text = status_text(reply, {.paint = Paint::yes});
  const std::string bad = "\033[1;38;5;130m", plain = "\033[0m";
  for (const std::string line :
       {"mine: nothing can be stored: disk full", "mine: 2 runs given up: crashed too often",
        "mine: 3 runs without an estimate",
        "mine: 1 result compared with a second computation: 1 differ (none may)",
        "not served, tried again: is damaged",
        "host node7 is in quarantine: too many workers crashed there; `proofmass release node7 "
        "--connect ADDRESS`"}) {
    EXPECT_NE(text.find(bad + line + plain + "\n"), std::string::npos) << line << "\n" << text;
  }
  EXPECT_EQ(std::ranges::count(text, '\033'), 14) << "and the titles";
}

TEST(WorkersTable, SaysWhichCardsThereAreAndHowFastTheyAre) {
  proto::WorkerStatus with_cards = worker(7, "gpu");
  with_cards.set_cards("2 NVIDIA H100 80GB HBM3 (CUDA 13.0)");
  const auto remark = [&] { return workers_table(reply_of({with_cards})).remarks.at(0).text; };
  EXPECT_EQ(remark(), "7: 2 NVIDIA H100 80GB HBM3 (CUDA 13.0)");
  with_cards.set_card_rate_hz(2053.7);
  EXPECT_EQ(remark(), "7: 2 NVIDIA H100 80GB HBM3 (CUDA 13.0), 2054 runs/s");
}

// It still has what it was lent before.
TEST(WorkersTable, SaysThatAWorkerInQuarantineIsLentNothingMore) {
  proto::WorkerStatus quarantined = worker(7, "w");
  quarantined.set_num_lent(16);
  quarantined.set_is_quarantined(true);
  EXPECT_EQ(workers_table(reply_of({quarantined})).remarks.at(0).text,
            "7: in quarantine, is lent nothing more: too many crashes on n7");
}

TEST(CampaignLine, SaysThatMostRunsWereGivenUp) {
  proto::CampaignStatus status = campaign("a", 40);
  status.set_phase(proto::CAMPAIGN_PHASE_FINISHED);
  status.set_num_given_up(50);
  EXPECT_TRUE(campaign_line(status).starts_with("a finished: 40 of 100 runs"));
  status.set_num_given_up(51);
  EXPECT_TRUE(campaign_line(status).starts_with("a failed: 40 of 100 runs"));
}

}  // namespace
}  // namespace proofmass::coordinator
