#include <fmt/format.h>

#include "coordinator/report/read_results.hpp"
#include "core/result_rules.hpp"
#include "tests/coordinator/archive/archive_fixture.hpp"
#include "tests/coordinator/archive/verification_fixture.hpp"
#include "tests/support/microscope_results.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

// Every column of every table: what changes in a finished campaign is found, or is known not to be.

/// Why no check can hold a column. coordinator/archive/README.md sums them up.
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
    {"worker.cards", "told by the worker alone"},
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
    campaign_.scenario.noise.thrust_asd_m_s2 = 8e-9;  // Loud enough for warnings.
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
    return check_stop_rule(test::parse_stop_rule("mean(k2c) within 90%"), errors);
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

  /// Whether a check fails, but for that of the model: without it nothing is simulated. Those after
  /// the first one that fails are left out.
  [[nodiscard]] bool is_noticed() const {
    bool is_noticed = false;
    try {
      verify(
          file(), {.model_version = "none"},
          [&](const Check& check) {
            is_noticed |= check.verdict == CheckOutcome::fails && check.name != "model";
          },
          [&] {
            if (is_noticed) throw Interrupted();
          });
    } catch (const Interrupted&) {
      EXPECT_TRUE(is_noticed);
    }
    return is_noticed;
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
        if (!is_noticed()) is_found = false;
      }
    }
    EXPECT_GT(num_changes, 0) << table << "." << column;
    return is_found;
  }
};

TEST_F(ColumnChange, IsFoundUnlessItIsKnownNotToBe) {
  ASSERT_THAT(failing({.fraction = 0.0}), IsEmpty())
      << check("integrity").finding << testing::PrintToString(check("statistics").details)
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
