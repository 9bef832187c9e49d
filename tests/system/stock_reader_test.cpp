// A file that a coordinator writes, read by what everybody has: the sqlite3 shell and Python.

#include <gtest/gtest.h>
#include <signal.h>

#include <filesystem>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "tests/skip_for_want.hpp"
#include "tests/system/fault_fixture.hpp"

namespace proofmass::test {
namespace {

/// Prints each table and view with its number of columns and of rows, all of which it reads.
constexpr const char* python_reader = R"py(
import sqlite3, sys
connection = sqlite3.connect("file:" + sys.argv[1] + "?mode=ro", uri=True)
kinds = "SELECT name FROM sqlite_schema WHERE type IN ('table', 'view')"
for (name,) in connection.execute(kinds).fetchall():
    cursor = connection.execute("SELECT * FROM " + name)
    print(name, len(cursor.description), len(cursor.fetchall()))
)py";

class StockReader : public FaultTest {
 protected:
  void SetUp() override {
    FaultTest::SetUp();
    write_null_campaign(1'000'000);  // More than will be computed.
    for (const char* program : {"/usr/bin/sqlite3", "/usr/bin/python3"}) {
      if (!std::filesystem::exists(program)) {
        skip_for_want(std::string("no ") + program);
        return;
      }
    }
  }

  /// The output of a program, which must succeed without a complaint.
  [[nodiscard]] std::string output(const std::string& program, const Arguments& arguments) const {
    Process process(directory / "", "reader", program, arguments);
    EXPECT_EQ(process.wait(), 0) << errors_of("reader");
    EXPECT_EQ(errors_of("reader"), "");
    return read_file(path("reader.out"));
  }
  [[nodiscard]] std::string in_shell(const std::string& sql) const {
    return output("/usr/bin/sqlite3", {"-readonly", file_of("null").string(), sql});
  }
};

std::vector<std::string> lines(const std::string& text) {
  std::istringstream stream(text);
  std::vector<std::string> lines;
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

TEST_F(StockReader, ReadsEveryTableAndViewOfARunningCampaign) {
  Process coordinator = this->coordinator("coordinator", {"null.toml"});
  const Process worker = null_worker("worker", {"--run-time", "0.0005"});
  wait_for_done("null", 100);
  const std::size_t num_before = num_done("null");

  const std::vector<std::string> names =
      lines(in_shell("SELECT name FROM sqlite_schema WHERE type IN ('table', 'view')"));
  const std::set<std::string> present(names.begin(), names.end());
  for (const char* view : {"parameter_accuracy", "budget", "error_long", "worst_runs", "overruns",
                           "campaign_progress", "worker_throughput", "attempt_history"}) {
    EXPECT_TRUE(present.contains(view)) << view;
  }
  for (const std::string& name : names) {
    EXPECT_NE(in_shell("SELECT count(*) FROM " + name), "") << name;
    (void)in_shell("SELECT * FROM " + name);
  }
  const std::vector<std::string> rows =
      lines(output("/usr/bin/python3", {"-c", python_reader, file_of("null").string()}));
  EXPECT_EQ(rows.size(), names.size());
  EXPECT_EQ(lines(in_shell("SELECT * FROM worst_runs")).size(), 100U);

  // It was, and is, being written all the while.
  wait_for_done("null", num_before + 100);
  coordinator.signal(SIGTERM);
  EXPECT_EQ(coordinator.wait(), 0) << errors_of("coordinator");
  EXPECT_EQ(num_log_lines("coordinator", "storage_failed"), 0U);
  EXPECT_EQ(in_shell("PRAGMA integrity_check"), "ok\n");
}

}  // namespace
}  // namespace proofmass::test
