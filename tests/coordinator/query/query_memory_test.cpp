#include <gtest/gtest.h>

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>

#include "coordinator/query/query_process.hpp"
#include "tests/coordinator/query/query_fixture.hpp"

namespace proofmass::test {
namespace {

using namespace coordinator;

/// Queries whose process may have 256 MiB.
class QueryMemory : public QueryTest {
 protected:
  void SetUp() override {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    GTEST_SKIP() << "sanitizers need more address space than any limit";
#endif
    make_file(campaign_of(4));
  }

  /// What is said of a query, or what it prints.
  [[nodiscard]] std::string answer_to(const std::string& sql) const {
    const QueryLimits limits{.time_limit = std::chrono::seconds(60),
                             .memory_size_max = std::uint64_t{256} << 20};
    std::string text;
    const QueryOutput output{.format = RowFormat::csv,
                             .table = {},
                             .sink = [&](std::string_view rows) { text += rows; },
                             .flush = [] {}};
    try {
      (void)run_query_in_process(file(), sql, limits, output);
    } catch (const Error& error) {
      return error.what();
    }
    return text;
  }
};

/// Columns `<begin>1), <begin>2) ...`; SQLite computes equal ones only once.
std::string columns(const std::string& begin, int count) {
  std::string text;
  for (int i = 1; i <= count; ++i) {
    text += (i == 1 ? "" : ", ") + begin + std::to_string(i) + ")";
  }
  return text;
}

constexpr const char* refusal = "memory = 256 MiB (the query needs more; ask for less)";

// A row of 20 texts of 60 MB, which SQLite has to hold all at once.
TEST_F(QueryMemory, EndsAQueryWhoseValuesNeedMore) {
  EXPECT_EQ(answer_to("SELECT " + columns("hex(zeroblob(30000000) || ", 20)), refusal);
}

// 40 lists of a million values, 8 bytes each.
TEST_F(QueryMemory, EndsAQueryWhoseAggregatesNeedMore) {
  EXPECT_EQ(answer_to("WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n LIMIT 1000) "
                      "SELECT " +
                      columns("percentile(a.i * b.i, ", 40) + " FROM n AS a, n AS b"),
            refusal);
}

TEST_F(QueryMemory, SufficesForOneOfThem) {
  EXPECT_EQ(answer_to("SELECT length(hex(zeroblob(30000000))) AS n"), "n\r\n60000000\r\n");
}

}  // namespace
}  // namespace proofmass::test
