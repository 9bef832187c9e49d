#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "coordinator/archive/comparison.hpp"
#include "coordinator/report/summarise.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "core/statistics/error_change.hpp"
#include "tests/coordinator/archive/archive_fixture.hpp"
#include "tests/coordinator/archive/verification_fixture.hpp"
#include "tests/core/statistics/columns.hpp"
#include "tests/proto/link/scratch_directory.hpp"
#include "tests/support/microscope_results.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

using Json = nlohmann::json;

bool never_stopped() { return false; }

/// Databases of campaigns whose errors of parameter i are ±scale·(i + 1)·(run + 1)·1e-9, by turns.
class SeveralComparison : public testing::Test {
 protected:
  void write(const std::string& name, double scale, std::uint64_t seed = 1,
             std::uint64_t num_finished = 40) {
    MicroscopeCampaign campaign = test::campaign_of(40);
    campaign.seed = seed;
    campaign.scenario.noise.scale = scale;
    std::vector<RunResult> results;
    for (std::uint64_t run = 0; run < num_finished; ++run) {
      RunResult result = test::zero_result({.run = {run}, .num_draws = 1, .num_rounds = 2});
      for (std::size_t i = 0; i < num_parameters; ++i) {
        const double error = 1e-9 * scale * static_cast<double>((i + 1) * (run + 1));
        result.estimate[i] = run % 2 == 0 ? error : -error;
      }
      results.push_back(result);
    }
    files_.push_back(directory_ / name);
    (void)test::store_of(files_.back(), campaign, results);
  }

  [[nodiscard]] std::vector<ComparedMember> compared() const {
    return compare_several(files_, never_stopped);
  }

  const test::ScratchDirectory directory_;
  std::vector<std::filesystem::path> files_;
};

// Of 40 runs the worst error is 40, the mean 20.5 and the standard deviation √(40·41/12), all times
// scale·(i + 1)·1e-9.
TEST_F(SeveralComparison, HasTheStatisticsOfAllRunsOfEach) {
  const std::vector<double> scales{1.0, 2.0, 0.5};
  for (const double scale : scales) write("scale" + std::to_string(scale) + ".db", scale);
  const std::vector<ComparedMember> members = compared();
  ASSERT_EQ(members.size(), 3U);
  for (std::size_t member = 0; member < 3; ++member) {
    EXPECT_EQ(members[member].statistics.num_estimated, 40U);
    for (std::size_t i = 0; i < num_parameters; ++i) {
      const double unit = 1e-9 * scales[member] * static_cast<double>(i + 1);
      const AccuracyStatistic& accuracy = members[member].statistics.accuracy[i];
      EXPECT_NEAR(accuracy.worst / unit, 40.0, 1e-12);
      EXPECT_NEAR(accuracy.mean / unit, 20.5, 1e-12);
      EXPECT_NEAR(accuracy.standard_deviation / unit, std::sqrt(40.0 * 41.0 / 12.0), 1e-12);
    }
  }
  EXPECT_FALSE(members[0].comparison.has_value());
  ASSERT_TRUE(members[1].comparison.has_value());
  EXPECT_TRUE(members[1].comparison->is_paired());
}

// Holm's method over both comparisons: the smallest of their 2·30 p-values is multiplied by the
// weights of all, 2·10 (of 0.5, 0.4 and 0.1 for each parameter), over its own, 0.4.
TEST_F(SeveralComparison, CorrectsForAllCampaignsTogether) {
  write("a.db", 1.0);
  write("b.db", 1.0);
  write("c.db", 3.0);
  const std::vector<ComparedMember> members = compared();
  double smallest = 1.0;
  for (const ParameterComparison& parameter : members[2].comparison->parameters) {
    smallest = std::min(smallest, parameter.p_values.scale);
  }
  ASSERT_LT(smallest, 1e-6);
  for (const ParameterComparison& parameter : members[2].comparison->parameters) {
    if (parameter.p_values.scale != smallest) continue;
    EXPECT_NEAR(parameter.adjusted_p_values.scale / smallest, 50.0, 1e-9);
  }
  for (const ParameterComparison& parameter : members[1].comparison->parameters) {
    EXPECT_EQ(parameter.adjusted_p_values.scale, 1.0);
  }
}

TEST_F(SeveralComparison, MarksWhatIsSignificantlyDifferentFromTheFirst) {
  write("a.db", 1.0);
  write("b.db", 1.0);
  write("c.db", 3.0);
  const std::string text = comparison_text(compared(), lettered(3));
  std::istringstream stream(text);
  std::size_t num_rows = 0;
  for (std::string line; std::getline(stream, line);) {
    const bool names_a_file = line.find(".db") != line.npos || line.find("─  ─") != line.npos;
    EXPECT_TRUE(names_a_file || display_width(line) <= 80U) << line;
    const std::string blanks(19, ' ');
    if (line.starts_with(blanks + "B ")) {
      EXPECT_THAT(line, Not(HasSubstr("*")));
    }
    if (line.starts_with(blanks + "C ") && line.find(" *") != std::string::npos) ++num_rows;
  }
  EXPECT_EQ(num_rows, num_parameters) << "whose scatter differs";
}

TEST_F(SeveralComparison, IsCompleteAsJson) {
  write("a.db", 1.0);
  write("b.db", 2.0);
  write("c.db", 0.5);
  const std::vector<std::vector<KeyText>> varied{
      {{"noise.scale", "1"}}, {{"noise.scale", "2"}}, {{"noise.scale", "0.5"}}};
  const Json json = Json::parse(comparison_json(compared(), varied));
  ASSERT_EQ(json["campaigns"].size(), 3U);
  const Json& second = json["campaigns"][1];
  EXPECT_EQ(second["varied"]["noise.scale"], "2");
  EXPECT_EQ(second["file"], files_[1].string());
  EXPECT_EQ(second["num_with_estimate"], 40);
  EXPECT_EQ(second["digest"].get<std::string>().size(), 64U);
  EXPECT_EQ(second["parameters"].size(), num_parameters);
  EXPECT_EQ(second["comparison"]["first"], files_[0].string());
  EXPECT_EQ(second["comparison"]["differences"][0]["field"], "noise.scale");
  EXPECT_TRUE(json["campaigns"][0]["comparison"].is_null());
}

TEST(Letters, GoOnWithTwoAfterZ) {
  const MemberNames names = lettered(703);
  EXPECT_EQ(names.names[0], "A");
  EXPECT_EQ(names.names[25], "Z");
  EXPECT_EQ(names.names[26], "AA");
  EXPECT_EQ(names.names[701], "ZZ");
  EXPECT_EQ(names.names[702], "AAA");
}

// Every column of every table: what changes in a finished campaign is found, or is known not to be.

/// Why no check can hold a column. The README of this folder has the same table.
const std::map<std::string, std::string> unheld{
    {"campaign.phase", "how the campaign is served; may be changed at any time"},
    {"campaign.priority", "how the campaign is served; may be changed at any time"},
    {"campaign.audit_fraction", "how the campaign is served; may be changed at any time"},
    {"campaign.is_log_needed", "whether the file is whole without its log, at this moment"},
    {"campaign.first_version", "whether budgets are compared"},
    {"delivery.attempt", "told by the worker's lease alone"},
    {"delivery.received_unix_s", "a time of the wall clock; the newest of a worker is held"},
    {"worker.session", "told by the worker alone"},
    {"worker.worker", "told by the worker alone"},
    {"worker.host", "told by the worker alone"},
    {"worker.process_id", "told by the worker alone"},
    {"worker.num_slots", "told by the worker alone"},
    {"worker.first_seen_utc", "a time of the wall clock"},
    {"worker.ended_utc", "a time of the wall clock"},
    {"worker.end_reason", "told by the coordinator of the time alone"},
    {"attempt.attempt_id", "a number in the order of the losses"},
    {"attempt.first_run", "told by the coordinator of the time alone"},
    {"attempt.num_runs", "told by the coordinator of the time alone"},
    {"attempt.attempt", "told by the coordinator of the time alone"},
    {"attempt.reason", "told by the coordinator of the time alone"},
    {"attempt.is_blamed", "told by the coordinator of the time alone"},
    {"attempt.lost_unix_s", "a time of the wall clock"},
    {"run_failure.reason", "told by the coordinator of the time alone"},
    {"run_failure.num_attempts", "told by the coordinator of the time alone"},
    {"run_failure.given_up_utc", "a time of the wall clock"},
    {"audit.compared_unix_s", "a time of the wall clock"},
    {"coordinator_start.start_id", "a number in the order of the starts"},
    {"coordinator_start.epoch", "a random number"},
    {"coordinator_start.host", "told by the coordinator of the time alone"},
    {"coordinator_start.process_id", "told by the coordinator of the time alone"},
    {"coordinator_start.version", "told by the coordinator of the time alone"},
    {"coordinator_start.started_utc", "a time of the wall clock"},
    {"coordinator_start.ended_utc", "a time of the wall clock"},
    {"event.event_id", "a number in the order of the events"},
    {"event.time_utc", "a time of the wall clock"},
    {"event.kind", "told by the coordinator of the time alone"},
    {"event.text", "told by the coordinator of the time alone"},
    {"stop_check.is_reached", "of an older check: the rule may have asked for another width"},
    {"summary.computed_utc", "a time of the wall clock"},
    {"stop_check.checked_utc", "a time of the wall clock"},
    {"tag.tag", "what people add"},
    {"tag.added_utc", "what people add"},
    {"note.note_id", "what people add"},
    {"note.time_utc", "what people add"},
    {"note.text", "what people add"},
};

class ColumnChange : public test::VerificationTest {
 protected:
  /// A campaign that has ended by a rule, with a row in each table.
  void SetUp() override {
    campaign_.scenario.environment.kind = EnvironmentKind::file;
    campaign_.environment_file = "environment.csv";
    for (double time_s = -400.0; time_s < 6800.0; time_s += 200.0) {
      campaign_.environment_table.push_back(
          {.time_s = time_s, .linear_m_s2 = {1e-8, 2e-8, 3e-8}, .angular_rad_s2 = {0, 0, 0}});
    }
    campaign_.dispersions[0].law = Law::table;
    campaign_.dispersions[0].file = "table.csv";
    campaign_.dispersions[0].column = "k";
    campaign_.dispersions[0].is_independent = true;
    campaign_.table_columns = {std::vector<double>(18, 1e-3)};
    static const std::vector<RunResult> results = test::simulated(campaign_);
    results_ = results;
    results_.pop_back();  // The last run is given up.
    Store store = test::store_of(file(), campaign_, results_);
    store.begin_coordinator({.epoch = {7}, .host = "h", .process_id = 1, .version = "v"});
    store.record_event("kind", "text");
    const Delivery again{.result = results_[5], .worker = test::session_1, .attempt = {2}};
    const std::vector<Entry> entries{SecondDelivery{again},
                                     ReturnedRuns{.runs = {RunIndex{17}, 1},
                                                  .attempt = {1},
                                                  .worker = test::session_1,
                                                  .reason = wire::LossReason::crashed,
                                                  .is_blamed = true},
                                     GivenUpRun{.run = RunIndex{17}},
                                     WorkerEnded{.session = test::session_1}};
    (void)store.write(entries);
    store.set_stop_plan(
        {.stop_rule = "mean(k2c) within 90%", .num_runs_max = 18, .failures_max = 5});
    (void)summarise_file(file(), campaign_,
                         [&](const std::function<void(Store&)>& action) { action(store); });
    store.record_stop_check(17, "mean(k2c)", *first_check());
    const Entry finished = CampaignControl{.phase = wire::CampaignPhase::finished};
    (void)store.write({&finished, 1});
  }

  /// The rule with the runs [0, 17), none of which was given up.
  [[nodiscard]] std::optional<StopCheck> first_check() const {
    std::vector<double> errors;
    for (const RunResult& result : results_) {
      errors.push_back(std::abs(result.error(index(Parameter::k2c))));
    }
    return check_stop_rule(parse_stop_rule("mean(k2c) within 90%"), errors);
  }

  /// Other values of a column of this type, as SQL.
  static std::vector<std::string> changes_of(const std::string& column, const std::string& type) {
    if (type.empty()) return {"1", "'x'"};  // NULL in all rows.
    if (type == "integer") return {column + " + 1", column + " - 1", column + " + 4294967296"};
    if (type == "real") return {fmt::format("iif({0} = 0, 1e-9, {0} * (1 + 1e-9))", column)};
    return {fmt::format("substr({0}, 1, length({0}) - 1) || iif(substr({0}, -1) = '1', '2', '1')",
                        column),
            "'paused'"};
  }

  /// Changes a column in the first row; false if the row keeps its condition only without this.
  bool is_changed(const std::string& table, const std::string& column, const std::string& value,
                  const std::string& setting, bool is_null) {
    detail::Database database(file(), detail::Access::read_write);
    database.execute(setting);
    const bool has_rowid =
        database.integer(fmt::format("SELECT sql NOT LIKE '%WITHOUT ROWID%' FROM sqlite_schema"
                                     " WHERE name = '{}'",
                                     table)) != 0;
    const std::string row = has_rowid ? "rowid" : column;
    try {
      database.execute(
          fmt::format("UPDATE {1} SET {0} = {2} WHERE {3} = (SELECT {3} FROM {1} WHERE"
                      " {0} IS NOT NULL OR {4} LIMIT 1)",
                      column, table, value, row, is_null));
    } catch (const StoreError&) {
      return false;
    }
    return true;
  }

  [[nodiscard]] std::string type_of(const std::string& table, const std::string& column) const {
    return detail::Database(file(), detail::Access::read_only)
        .text(fmt::format("SELECT coalesce((SELECT typeof({0}) FROM {1} WHERE {0} IS NOT NULL"
                          " LIMIT 1), '')",
                          column, table));
  }

  /// Checks that fail, but for that of the model: without it nothing is simulated.
  std::vector<std::string> failing() {
    checks_.clear();
    (void)verify(
        file(), {.model_version = "none"},
        [&](const Check& check) { checks_.emplace(check.name, check); }, test::never_stopped);
    std::vector<std::string> failing = names(CheckOutcome::fails);
    std::erase(failing, "model");
    return failing;
  }

  void restore() const {
    std::filesystem::copy_file(directory() / "original.db", file(),
                               std::filesystem::copy_options::overwrite_existing);
  }

  /// Whether each change of a column is found; a change that no condition of the table forbids, if
  /// there is one.
  bool is_every_change_found(const std::string& table, const std::string& column) {
    const std::string type = type_of(table, column);
    int num_changes = 0;
    bool is_found = true;
    for (const std::string setting : {"PRAGMA foreign_keys = OFF",
                                      "PRAGMA foreign_keys = OFF;"
                                      "PRAGMA ignore_check_constraints = ON"}) {
      if (num_changes > 0) break;
      for (const std::string& value : changes_of(column, type)) {
        restore();
        if (!is_changed(table, column, value, setting, type.empty())) continue;
        ++num_changes;
        if (failing().empty()) is_found = false;
      }
    }
    EXPECT_GT(num_changes, 0) << table << "." << column;
    return is_found;
  }
};

TEST_F(ColumnChange, IsFoundUnlessItIsKnownNotToBe) {
  ASSERT_TRUE(verify_all(0.0)) << check("integrity").finding
                               << testing::PrintToString(check("statistics").details)
                               << check("stop_checks").finding;
  {
    detail::Database database(file(), detail::Access::read_write);
    database.execute("INSERT INTO tag (tag) VALUES ('t'); INSERT INTO note (text) VALUES ('n')");
  }
  std::filesystem::copy_file(file(), directory() / "original.db");
  std::vector<std::pair<std::string, std::string>> columns;
  {
    const detail::Database database(file(), detail::Access::read_only);
    detail::Statement row = database.prepare(
        "SELECT t.name, c.name FROM sqlite_schema AS t JOIN pragma_table_xinfo(t.name) AS c"
        " WHERE t.type = 'table' AND t.name NOT LIKE 'sqlite_%' AND c.hidden = 0");
    while (row.step()) columns.emplace_back(row.text(0), row.text(1));
  }
  for (const auto& [table, column] : columns) {
    const std::string name = table + "." + column;
    const bool is_found = is_every_change_found(table, column);
    EXPECT_NE(is_found, unheld.contains(name))
        << name << (is_found ? " is held" : " was changed, and no check fails");
  }
}

}  // namespace
}  // namespace proofmass::coordinator
