// Files that somebody made to do harm: every program that opens one refuses it soon, and goes on.

#include <gtest/gtest.h>
#include <signal.h>
#include <sqlite3.h>

#include <chrono>
#include <filesystem>
#include <regex>
#include <string>
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
    ASSERT_EQ(start("good", {"--workers", "1", "--runs", "16"}).wait(), 0) << errors_of("good");
  }

  void make(const std::string& name, const std::string& sql) const {
    fs::copy_file(path("good.db"), path(name), fs::copy_options::overwrite_existing);
    change(path(name), sql);
  }

  /// What a command says on both streams, without line breaks; it must end soon.
  [[nodiscard]] std::string answer(const Arguments& arguments) const {
    const auto begin = std::chrono::steady_clock::now();
    Process command(directory / "", "command", programs + "/proofmass", arguments);
    (void)command.wait();
    EXPECT_LT(std::chrono::steady_clock::now() - begin, soon);
    return std::regex_replace(read_file(path("command.out")) + errors_of("command"),
                              std::regex("\\s+"), " ");
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
                                        {"verify", "hostile.db"},
                                        {"export", "hostile.db"},
                                        {"backup", "hostile.db", "copy.db"},
                                        {"compare", "hostile.db", "good.db"},
                                        {"compare", "good.db", "hostile.db"},
                                        {"sensitivity", "hostile.db"},
                                        {"tag", "hostile.db", "add", "a"},
                                        {"note", "hostile.db", "text"},
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

}  // namespace
}  // namespace proofmass::test
