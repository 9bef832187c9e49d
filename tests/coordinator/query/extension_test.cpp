#include <fmt/format.h>

#include "tests/coordinator/query/query_fixture.hpp"
#include "tests/test.hpp"

namespace proofmass::test {
namespace {

/// The extension in processes of other programs.
class Extension : public QueryTest {
 protected:
  /// What a shell command prints, errors included.
  [[nodiscard]] std::string output_of(const std::string& command) const {
    const auto out = directory() / "out";
    status_ = std::system(fmt::format("{} > '{}' 2>&1", command, out.string()).c_str());
    std::stringstream text;
    text << std::ifstream(out).rdbuf();
    return text.str();
  }
  /// What the stock shell answers to a question about the file.
  [[nodiscard]] std::string answer_to(const std::string& sql) const {
    return output_of(fmt::format("sqlite3 -readonly '{}' \".load '{}'\" \"{}\"", file().string(),
                                 PROOFMASS_EXTENSION, sql));
  }

  mutable int status_ = 0;
};

TEST_F(Extension, WorksInTheStockShell) {
  make_file(campaign_of(5), 5);
  EXPECT_EQ(answer_to("SELECT stdev(run_index), percentile(run_index, 25) FROM run_result"),
            "1.58113883008419|1.0\n");
  EXPECT_EQ(status_, 0);
  EXPECT_EQ(answer_to("SELECT count(*), max(run_index) FROM draw"), "305|4\n");
}

TEST_F(Extension, DrawsTheSameBitsAsTheProgram) {
  make_file(campaign_of(5));
  std::string expected;
  for (const auto& row : rows_of("SELECT printf('%!.20g', value) FROM draw")) {
    expected += std::get<std::string>(row[0]) + "\n";
  }
  EXPECT_EQ(answer_to("SELECT printf('%!.20g', value) FROM draw"), expected);
}

TEST_F(Extension, SaysThatADatabaseHoldsNoCampaign) {
  const std::string output = output_of(
      fmt::format("sqlite3 :memory: \".load '{}'\" 'SELECT * FROM draw'", PROOFMASS_EXTENSION));
  EXPECT_THAT(output,
              EndsWith("draw: the campaign cannot be read: no such table: main.campaign\n"));
  EXPECT_NE(status_, 0);
}

TEST_F(Extension, SeesThatACampaignGrew) {
  make_file(campaign_of(2));
  const std::string shell =
      output_of(fmt::format("sqlite3 '{}' \".load '{}'\" 'SELECT max(run_index) FROM draw' "
                            "\"UPDATE campaign SET num_runs = 9, "
                            "definition = replace(definition, 'runs = 2', 'runs = 9')\" "
                            "'SELECT max(run_index) FROM draw'",
                            file().string(), PROOFMASS_EXTENSION));
  EXPECT_EQ(shell, "1\n8\n");
}

TEST_F(Extension, SeesThatADefinitionChanged) {
  make_file(campaign_of(2));
  const std::string question = "'SELECT value FROM definition_entry WHERE key = \"noise.scale\"'";
  const std::string shell =
      output_of(fmt::format("sqlite3 '{}' \".load '{}'\" {} \"UPDATE campaign SET definition = "
                            "replace(definition, '\nscale = 1\n', '\nscale = 0.5\n')\" {}",
                            file().string(), PROOFMASS_EXTENSION, question, question));
  EXPECT_EQ(shell, "1.0\n0.5\n");
}

TEST_F(Extension, ExportsItsInitFunctionAndNothingElse) {
  EXPECT_EQ(
      output_of(fmt::format("nm -D --defined-only '{}' | cut -d' ' -f2-", PROOFMASS_EXTENSION)),
      "T sqlite3_proofmasssqlite_init\n");
}

TEST_F(Extension, CallsTheSqliteOfTheProgramThatLoadsIt) {
  EXPECT_THAT(output_of(fmt::format("nm -D --undefined-only '{}'", PROOFMASS_EXTENSION)),
              testing::Not(HasSubstr("sqlite3")));
}

// numpy, scipy and mpmath; the script stops at the first number that differs by 1e-12.
TEST_F(Extension, ComputesWhatAnExactComputationConfirms) {
  EXPECT_THAT(
      output_of(fmt::format("/usr/bin/python3 '{}' '{}'", PROOFMASS_ORACLE, PROOFMASS_EXTENSION)),
      testing::MatchesRegex("all [0-9]+ confirmed\n"));
  EXPECT_EQ(status_, 0);
}

}  // namespace
}  // namespace proofmass::test
