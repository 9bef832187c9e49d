// Files that somebody made to do harm: every program that opens one refuses it soon, and goes on.

#include <gtest/gtest.h>
#include <signal.h>
#include <sqlite3.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <regex>
#include <string>
#include <utility>
#include <vector>

#include "tests/system/fault_fixture.hpp"

namespace proofmass::test {
namespace {

namespace fs = std::filesystem;

// What would not end within the test.
constexpr std::chrono::seconds soon(30);
const std::string endless =
    "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT max(i) AS a FROM n";
const std::string endless_call = "instr(hex(zeroblob(16000000)), hex(zeroblob(8000000)) || '1')";

void change(const fs::path& file, const std::string& sql) {
  sqlite3* database = nullptr;
  ASSERT_EQ(sqlite3_open(file.c_str(), &database), SQLITE_OK);
  EXPECT_EQ(sqlite3_exec(database, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK)
      << sqlite3_errmsg(database);
  sqlite3_close(database);
}

/// A campaign `good.db` with 16 runs, and one that is changed for each attack.
class HostileFile : public FaultTest {
 protected:
  void SetUp() override {
    FaultTest::SetUp();
    // What `verify` simulates again takes little.
    const std::string text = read_file(path("short.toml"));
    std::ofstream(path("short.toml"))
        << std::regex_replace(text, std::regex("\norbits = [0-9]+"), "\norbits = 1");
    ASSERT_EQ(start("good", {"--workers", "1", "--runs", "16"}).wait(), 0) << errors_of("good");
  }

  void make(const std::string& name, const std::string& sql) const {
    fs::copy_file(path("good.db"), path(name), fs::copy_options::overwrite_existing);
    change(path(name), sql);
  }

  /// What a command says on both streams; it must end soon.
  [[nodiscard]] std::string output_of(const Arguments& arguments) const {
    const auto begin = std::chrono::steady_clock::now();
    Process command(directory / "", "command", programs + "/proofmass", arguments);
    (void)command.wait();
    EXPECT_LT(std::chrono::steady_clock::now() - begin, soon);
    return read_file(path("command.out")) + errors_of("command");
  }

  /// What a command says on both streams, without line breaks.
  [[nodiscard]] std::string answer(const Arguments& arguments) const {
    return std::regex_replace(output_of(arguments), std::regex("\\s+"), " ");
  }
};

TEST_F(HostileFile, IsRefusedByEveryCommand) {
  const std::vector<std::pair<std::string, std::string>> attacks{
      {"ALTER TABLE campaign RENAME TO c; CREATE VIEW campaign AS " + endless,
       "has what is no part of a campaign: table c"},
      {"DROP TABLE run_result; CREATE VIEW run_result AS " + endless,
       "has what is no part of a campaign: view run_result"},
      {"DELETE FROM event; CREATE INDEX slow ON event (" + endless_call + ")",
       "has what is no part of a campaign: index slow"},
      {"DELETE FROM note; ALTER TABLE note ADD COLUMN slow INTEGER AS (" + endless_call + ")",
       "has another definition of table note"}};
  const std::vector<Arguments> commands{{"list", "hostile.db"},
                                        {"list"},
                                        {"report", "hostile.db"},
                                        {"report", "hostile.db", "--html", "-"},
                                        {"plot", "hostile.db", "--list"},
                                        {"verify", "hostile.db"},
                                        {"export", "hostile.db", "--output", "a.h5"},
                                        {"replay", "hostile.db", "--run", "0"},
                                        {"backup", "hostile.db", "copy.db"},
                                        {"compare", "hostile.db", "good.db"},
                                        {"compare", "good.db", "hostile.db"},
                                        {"compare", "good.db", "hostile.db", "good.db"},
                                        {"sensitivity", "hostile.db"},
                                        {"query", "hostile.db", "SELECT 1"},
                                        {"run", "short.toml", "--db", "hostile.db"}};
  for (const auto& [sql, reason] : attacks) {
    make("hostile.db", sql);
    for (const Arguments& command : commands) {
      const std::string text = answer(command);
      EXPECT_TRUE(contains(text, reason)) << command.front() << ": " << text;
    }
    EXPECT_FALSE(fs::exists(path("copy.db")));
  }
}

TEST_F(HostileFile, DoesNotKeepACoordinatorFromTheOtherCampaigns) {
  fs::create_directory(path(served));
  make(served + "/hostile.db",
       "ALTER TABLE campaign RENAME TO c; CREATE VIEW campaign AS " + endless);
  write_null_campaign(64);
  Process coordinator = this->coordinator("coordinator", {"null.toml"});
  const Process worker = null_worker("worker");
  wait_for_log("coordinator", "campaign_finished");
  EXPECT_TRUE(
      contains(errors_of("coordinator"), "hostile.db (has what is no part of a campaign: table c)"))
      << errors_of("coordinator");
  EXPECT_EQ(digest("null"), undisturbed_digest("null"));
  coordinator.signal(SIGTERM);
  EXPECT_EQ(coordinator.wait(), 0) << errors_of("coordinator");
}

// Clears the screen, rings, goes back to the begin of the line, begins another, turns the direction
// of writing, and begins an order in eight bits.
const std::string evil = "\x1b[2J\a\rroot\nforged line\u202e\x7f\u009b31m";
const std::string evil_name = "\x1b[31m\nforged line.db";

/// The first thing in a text that a terminal would obey, or a line that nobody wrote.
std::string obeyed(const std::string& text) {
  for (const char* const order : {"\nforged line", "\u202e", "\u009b"}) {
    if (contains(text, order)) return order;
  }
  const auto is_control = [](unsigned char c) { return (c < 0x20 && c != '\n') || c == 0x7f; };
  const auto found = std::find_if(text.begin(), text.end(), is_control);
  return found == text.end() ? "" : std::string(1, *found);
}

/// Table and column of each text in a campaign database.
std::vector<std::pair<std::string, std::string>> text_columns(const fs::path& file) {
  sqlite3* database = nullptr;
  EXPECT_EQ(sqlite3_open(file.c_str(), &database), SQLITE_OK);
  std::vector<std::pair<std::string, std::string>> columns;
  const auto add = [](void* list, int, char** values, char**) {
    static_cast<decltype(columns)*>(list)->emplace_back(values[0], values[1]);
    return 0;
  };
  sqlite3_exec(database,
               "SELECT t.name, c.name FROM sqlite_schema AS t, pragma_table_info(t.name) AS c "
               "WHERE t.type = 'table' AND c.type = 'TEXT'",
               add, &columns, nullptr);
  sqlite3_close(database);
  return columns;
}

TEST_F(HostileFile, CannotSteerATerminalOrForgeALine) {
  make("good.db", "INSERT INTO tag (tag) VALUES ('old'); INSERT INTO note (text) VALUES ('text')");
  fs::create_directory(path(served));
  const auto columns = text_columns(path("good.db"));
  EXPECT_GT(columns.size(), 30U);
  std::size_t num_shown = 0;
  for (const auto& [table, column] : columns) {
    const std::string file = served + "/" + table + "." + column + ".db";
    make(file, "PRAGMA ignore_check_constraints = ON; UPDATE OR REPLACE " + table + " SET " +
                   column + " = '" + evil + "'");
    std::vector<Arguments> commands{{"report", file},
                                    {"report", file, "--html", "-"},
                                    {"report", file, "--markdown", "-"},
                                    {"verify", file, "--fraction", "0"},
                                    {"query", file, "SELECT " + column + " FROM " + table}};
    if (table == "campaign") {
      commands.push_back({"compare", file, "good.db"});
      commands.push_back({"sensitivity", file});
      commands.push_back({"query", file, "SELECT * FROM draw LIMIT 1"});
      commands.push_back({"run", "short.toml", "--db", file, "--runs", "16"});
    }
    for (const Arguments& command : commands) {
      const std::string text = output_of(command);
      EXPECT_EQ(obeyed(text), "") << command.front() << " " << file << ": " << text;
      if (contains(text, "\\u001b")) ++num_shown;
    }
  }
  EXPECT_GT(num_shown, columns.size());  // What is hidden altogether would pass.
  fs::copy_file(path("good.db"), path(served + "/" + evil_name));
  EXPECT_EQ(obeyed(output_of({"list", served})), "");
  Process coordinator = this->coordinator("coordinator", {});
  wait_for_log("coordinator", "coordinator_started");
  EXPECT_EQ(obeyed(told({"status"})), "");
  EXPECT_EQ(obeyed(told({"workers"})), "");
  coordinator.signal(SIGTERM);
  EXPECT_EQ(coordinator.wait(), 0);
  EXPECT_EQ(obeyed(errors_of("coordinator")), "") << errors_of("coordinator");
  EXPECT_GT(num_log_lines("coordinator", "\\u001b"), 0U) << errors_of("coordinator");
}

}  // namespace
}  // namespace proofmass::test
