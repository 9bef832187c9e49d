#include <fmt/format.h>
#include <gmock/gmock.h>
#include <signal.h>

#include <chrono>
#include <fstream>
#include <string>
#include <vector>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "tests/coordinator/store/store_fixture.hpp"
#include "tests/system/process.hpp"

namespace proofmass::test {
namespace {

using testing::HasSubstr;

/// `proofmass query` as a process.
class QueryProcess : public StoreTest {
 protected:
  QueryProcess() {
    const MicroscopeCampaign campaign = campaign_of(4);
    coordinator::Store store =
        coordinator::Store::create(file(), campaign, canonical_definition(campaign));
    const coordinator::Entry worker = worker_1();
    store.write({&worker, 1});
    store.commit(deliveries_of(0, 3));
  }

  /// Exit code of the query.
  int query(const std::vector<std::string>& arguments) {
    std::vector<std::string> all{"query", file().string()};
    all.insert(all.end(), arguments.begin(), arguments.end());
    return Process(directory(), "query", program(), all).wait();
  }
  /// The same with a shell's redirections.
  int query_in_shell(const std::string& rest) {
    const std::string command = program() + " query " + file().string() + " " + rest;
    return Process(directory(), "query", "/bin/sh", {"-c", command}).wait();
  }
  [[nodiscard]] static std::string program() {
    return std::string(PROOFMASS_PROGRAMS) + "/proofmass";
  }
  [[nodiscard]] std::string output() const { return read_file(directory() / "query.out"); }
  [[nodiscard]] std::string errors() const { return read_file(directory() / "query.err"); }
};

TEST_F(QueryProcess, PrintsATable) {
  EXPECT_EQ(query({"SELECT run_index, status FROM run_result"}), 0);
  EXPECT_EQ(output(),
            "run_index  status\n"
            "─────────  ──────\n"
            "        0       1\n"
            "        1       1\n"
            "        2       1\n");
  EXPECT_EQ(errors(), "");
}

TEST_F(QueryProcess, PrintsTheFormatThatIsAskedFor) {
  EXPECT_EQ(query({"SELECT 0.1 AS a", "--format", "csv"}), 0);
  EXPECT_EQ(output(), "a\r\n0.1\r\n");
  EXPECT_EQ(query({"SELECT 0.1 AS a", "--format", "json"}), 0);
  EXPECT_EQ(output(), "[\n {\"a\": 0.1}\n]\n");
  EXPECT_EQ(query({"SELECT 0.1 AS a", "--format", "markdown"}), 0);
  EXPECT_EQ(output(), "| a |\n| ---: |\n| 0.1 |\n");
}

TEST_F(QueryProcess, ReadsTheQueryFromStandardInput) {
  std::ofstream(directory() / "question.sql")
      << "SELECT count(*) AS n -- results\nFROM run_result;\n";
  EXPECT_EQ(query_in_shell("- --format csv < question.sql"), 0);
  EXPECT_EQ(output(), "n\r\n3\r\n");
}

TEST_F(QueryProcess, AttachesOtherFiles) {
  const std::string other = "b=" + file().string();
  EXPECT_EQ(query({"--attach", other, "--attach", "c=" + file().string(),
                   "SELECT (SELECT count(*) FROM b.run_result) AS n, (SELECT count(*) FROM "
                   "draw('c') WHERE run_index = 0) AS m",
                   "--format", "csv"}),
            0);
  EXPECT_EQ(output(), "n,m\r\n3,60\r\n");
  EXPECT_EQ(query({"SELECT 1", "--attach", other, "--attach", "B=x.db"}), 2);
  EXPECT_EQ(errors(), "proofmass: error: --attach B=x.db (its name is attached already)\n");
  EXPECT_EQ(query({"SELECT 1", "--attach", "x.db"}), 2);
  EXPECT_EQ(errors(), "proofmass: error: --attach x.db (must be NAME=FILE)\n");
  EXPECT_EQ(query({"SELECT 1", "--attach", "main=x.db"}), 2);
  EXPECT_THAT(errors(), HasSubstr("--attach main=x.db (name = main (must be 1 to 64 letters"));
  EXPECT_EQ(query({"SELECT 1", "--attach", "b=none.db"}), 1);
  EXPECT_EQ(errors(), "proofmass: error: campaign database = none.db (does not exist)\n");
  std::vector<std::string> arguments{"SELECT 1"};
  for (int i = 0; i < 11; ++i) {
    arguments.push_back("--attach");
    arguments.push_back(fmt::format("b{}={}", i, file().string()));
  }
  EXPECT_EQ(query(arguments), 2);
  EXPECT_EQ(errors(), "proofmass: error: --attach = 11 files (must be at most 10)\n");
}

TEST_F(QueryProcess, EndsWith2ForAWrongQuery) {
  EXPECT_EQ(query({"SELECT a FROM nowhere"}), 2);
  EXPECT_EQ(output(), "");
  EXPECT_EQ(errors(), "proofmass: error: sql = SELECT a FROM nowhere (no such table: nowhere)\n");
  EXPECT_EQ(query({"DELETE FROM run_result"}), 2);
  EXPECT_EQ(query({"SELECT 1", "--format", "xml"}), 2);
  EXPECT_EQ(query({"SELECT 1 AS a, 2 AS a", "--format", "json"}), 2);
  EXPECT_EQ(query_in_shell("- < /dev/zero"), 2);
  EXPECT_EQ(errors(), "proofmass: error: sql = - (standard input has more than 1000000 bytes)\n");
}

TEST_F(QueryProcess, EndsWith1ForWhatCannotBeDone) {
  EXPECT_EQ(query({"WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) "
                   "SELECT max(i) FROM n",
                   "--timeout", "0.2"}),
            1);
  EXPECT_EQ(errors(),
            "proofmass: error: timeout = 0.2 (the query did not end in so many seconds)\n");
  EXPECT_EQ(query_in_shell("'SELECT 1' > /dev/full"), 1);
  EXPECT_EQ(errors(), "proofmass: error: standard output: No space left on device\n");
  std::filesystem::remove(file());
  EXPECT_EQ(query({"SELECT 1"}), 1);
  EXPECT_THAT(errors(), HasSubstr("(does not exist)"));
}

TEST_F(QueryProcess, EndsWith130WhenItIsInterrupted) {
  Process query(
      directory(), "query", program(),
      {"query", file().string(), "--format", "csv",
       "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT i FROM n"});
  wait_until("first rows", [&] { return !output().empty(); });
  query.signal(SIGINT);
  EXPECT_EQ(query.wait(), 130);
  EXPECT_EQ(errors(), "");
}

// Each is one call of a function, during which SQLite looks at nothing else; by themselves they end
// after minutes or hours.
const std::vector<std::string> endless_calls{
    "instr(hex(zeroblob(16000000)), hex(zeroblob(8000000)) || '1')",
    "replace(hex(zeroblob(16000000)), hex(zeroblob(8000000)) || '1', '')",
    "hex(zeroblob(30000000)) LIKE '%' || hex(zeroblob(490)) || '1'",
    "hex(zeroblob(30000000)) GLOB '*' || hex(zeroblob(490)) || '1'"};
// Far more than the half second of grace, and far less than any of the calls.
constexpr std::chrono::seconds soon(30);

TEST_F(QueryProcess, EndsWithinTheTimeLimitWhateverAFunctionDoes) {
  for (const std::string& call : endless_calls) {
    const auto begin = std::chrono::steady_clock::now();
    EXPECT_EQ(query({"SELECT " + call, "--timeout", "0.5"}), 1);
    EXPECT_LT(std::chrono::steady_clock::now() - begin, soon) << call;
    EXPECT_EQ(errors(),
              "proofmass: error: timeout = 0.5 (the query did not end in so many seconds)\n");
  }
}

TEST_F(QueryProcess, EndsWith130InTheMidstOfAFunction) {
  for (const int signal : {SIGINT, SIGTERM}) {
    std::filesystem::remove(directory() / "query.out");
    Process query(directory(), "query", program(),
                  {"query", file().string(), "--format", "csv",
                   "SELECT i, CASE WHEN i = 3 THEN " + endless_calls[0] +
                       " END AS x FROM (SELECT 1 AS i UNION ALL SELECT 2 UNION ALL SELECT 3)"});
    wait_until("rows", [&] { return output().ends_with("2,\r\n"); });
    const auto begin = std::chrono::steady_clock::now();
    query.signal(signal);
    EXPECT_EQ(query.wait(), 130);
    EXPECT_LT(std::chrono::steady_clock::now() - begin, soon);
    EXPECT_EQ(errors(), "");
    EXPECT_EQ(output(), "i,x\r\n1,\r\n2,\r\n");
  }
}

// What bounds a question to a coordinator bounds all that it needs.
TEST_F(QueryProcess, IsOneProcessWith8GibibytesOfAddressSpace) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "sanitizers need more address space than any limit";
#endif
  Process query(directory(), "query", program(),
                {"query", file().string(), "--format", "csv",
                 "SELECT 1 UNION ALL SELECT " + endless_calls[0]});
  wait_until("a row", [&] { return output().ends_with("1\r\n"); });
  EXPECT_TRUE(query.children().empty());
  EXPECT_THAT(read_file("/proc/" + std::to_string(query.id()) + "/limits"),
              testing::ContainsRegex("Max address space +8589934592 +8589934592 "));
  query.signal(SIGINT);
  EXPECT_EQ(query.wait(), 130);
}

/// Columns `<begin>1), <begin>2) ...`; SQLite computes equal ones only once.
std::string columns(const std::string& begin, int count) {
  std::string text;
  for (int i = 1; i <= count; ++i) {
    text += (i == 1 ? "" : ", ") + begin + std::to_string(i) + ")";
  }
  return text;
}

// The kernel holds the limit, whichever way a query takes memory.
TEST_F(QueryProcess, EndsWith1WhenItNeedsMoreMemoryThanItMayHave) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "sanitizers need more address space than any limit";
#endif
  const auto query_within_300_mib = [&](const std::string& sql) {
    return Process(directory(), "query", "/usr/bin/prlimit",
                   {"--as=314572800", program(), "query", file().string(), sql, "--format", "csv"})
        .wait();
  };
  const std::vector<std::string> greedy{
      // A row of 20 texts of 60 MB, which SQLite has to hold all at once.
      "SELECT " + columns("hex(zeroblob(30000000) || ", 20),
      // 40 lists of a million values, 8 bytes each.
      "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n LIMIT 1000) SELECT " +
          columns("percentile(a.i * b.i, ", 40) + " FROM n AS a, n AS b"};
  for (const std::string& sql : greedy) {
    EXPECT_EQ(query_within_300_mib(sql), 1);
    EXPECT_EQ(errors(),
              "proofmass: error: memory = 300 MiB (the query and what it sorts need more; ask for "
              "less, or query a copy of the database elsewhere)\n");
  }
  EXPECT_EQ(query_within_300_mib("SELECT length(hex(zeroblob(30000000))) AS n"), 0) << errors();
  EXPECT_EQ(output(), "n\r\n60000000\r\n");
}

}  // namespace
}  // namespace proofmass::test
