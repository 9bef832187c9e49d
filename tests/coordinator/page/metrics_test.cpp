#include <regex>

#include "coordinator/page/page.hpp"
#include "tests/coordinator/page/page_fixture.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

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

}  // namespace
}  // namespace proofmass::coordinator
