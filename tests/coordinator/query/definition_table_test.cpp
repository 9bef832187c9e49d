#include <fmt/format.h>
#include <gmock/gmock.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "core/microscope/definition/campaign_definition.hpp"
#include "tests/coordinator/query/query_fixture.hpp"

namespace proofmass::test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

using Pairs = std::vector<std::pair<std::string, std::string>>;

/// `a = 1, b = "x"` as pairs, each key with a prefix. No text in these campaigns has a comma.
void add_inline(const std::string& prefix, const std::string& text, Pairs& pairs) {
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find(", ", begin), text.size());
    const std::string part = text.substr(begin, end - begin);
    const std::size_t sign = part.find(" = ");
    pairs.emplace_back(prefix + part.substr(0, sign), part.substr(sign + 3));
    begin = end + 2;
  }
}

/// What stands between `{ ` and ` }`.
std::string inside(const std::string& line) {
  const std::size_t begin = line.find("{ ") + 2;
  return line.substr(begin, line.rfind(" }") - begin);
}

/// Keys and values of a canonical definition as they stand in its text, line by line; another
/// reader than that of campaign files.
Pairs pairs_of(const std::string& definition) {
  Pairs pairs;
  std::string prefix;
  int session = -1;
  int excitation = 0;
  std::istringstream stream(definition);
  for (std::string line; std::getline(stream, line);) {
    if (line == "[[session]]") {
      prefix = fmt::format("session[{}].", ++session);
    } else if (line.starts_with("[")) {
      prefix = line.substr(1, line.size() - 2) + ".";
    } else if (line.starts_with("excitations = ")) {
      excitation = 0;
    } else if (line.starts_with("  {")) {
      add_inline(fmt::format("{}excitations[{}].", prefix, excitation++), inside(line), pairs);
    } else if (prefix.starts_with("dispersion.")) {
      add_inline(prefix + line.substr(0, line.find(" = ")) + ".", inside(line), pairs);
    } else if (line != "]") {
      const std::size_t sign = line.find(" = ");
      pairs.emplace_back(prefix + line.substr(0, sign), line.substr(sign + 3));
    }
  }
  return pairs;
}

/// Laws of every kind, a file, a session that spins.
MicroscopeCampaign varied_campaign() {
  MicroscopeCampaign campaign = campaign_of(2);
  campaign.name = "varied";
  campaign.seed = 9'223'372'036'854'775'807U;
  campaign.scenario.sessions[2].spin_rate_rad_s = 1.0 / 3000.0;
  auto& laws = campaign.dispersions;
  laws[0].law = Law::normal;
  laws[0].standard_deviation = 1.0 / 700.0;
  laws[1].law = Law::truncated_normal;
  laws[1].standard_deviation = 4e-3;
  laws[24].law = Law::fixed;
  laws[24].value = 1.25e-5;
  laws[25] = {.law = Law::table, .file = "a \"b\".csv", .column = "y\\z"};
  campaign.table_columns = {{1e-5, 2e-5}};
  return campaign;
}

class DefinitionTable : public QueryTest {
 protected:
  [[nodiscard]] OwnCell value_of(const std::string& key) const {
    return rows_of("SELECT value FROM definition_entry WHERE key = '" + key + "'").at(0).at(0);
  }
};

// Texts lose their quotation marks and escapes, numbers are the same double.
void expect_same(const OwnCell& cell, const std::string& text, const std::string& key) {
  if (text.starts_with('"')) {
    std::string plain;
    for (std::size_t i = 1; i + 1 < text.size(); ++i) plain += text[text[i] == '\\' ? ++i : i];
    EXPECT_EQ(cell, OwnCell(plain)) << key;
  } else if (text.starts_with('[')) {
    EXPECT_EQ(cell, OwnCell(text)) << key;
  } else if (const auto* integer = std::get_if<std::int64_t>(&cell)) {
    EXPECT_EQ(fmt::format("{}", *integer), text) << key;
  } else {
    ASSERT_TRUE(std::holds_alternative<double>(cell)) << key;
    EXPECT_EQ(std::get<double>(cell), std::strtod(text.c_str(), nullptr)) << key;
  }
}

TEST_F(DefinitionTable, HasTheKeysAndValuesOfTheCampaignFile) {
  const MicroscopeCampaign campaign = varied_campaign();
  make_file(campaign);
  Pairs pairs = pairs_of(canonical_definition(campaign));
  // The text leaves it out, as texts of older programs do.
  pairs.emplace_back("budget.test_spin_rate_rad_s", "0");
  const auto rows = rows_of("SELECT key, value FROM definition_entry ORDER BY key");
  // Excitations stand behind the other keys of their session in the text, before them in the table.
  std::ranges::sort(pairs);
  ASSERT_EQ(rows.size(), pairs.size());
  EXPECT_GT(rows.size(), 350U);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    EXPECT_EQ(rows[i][0], OwnCell(pairs[i].first));
    expect_same(rows[i][1], pairs[i].second, pairs[i].first);
  }
}

// A whole number among them would divide without its fraction.
TEST_F(DefinitionTable, HasDoublesAsDoublesAndWholeNumbersAsSuch) {
  make_file(varied_campaign());
  EXPECT_EQ(value_of("campaign.seed"), OwnCell(std::int64_t{9'223'372'036'854'775'807}));
  EXPECT_EQ(value_of("session[3].orbits"), OwnCell(std::int64_t{40}));
  EXPECT_EQ(value_of("estimation.transient_s"), OwnCell(1000.0));
  EXPECT_EQ(value_of("session[2].spin_rate_rad_s"), OwnCell(1.0 / 3000.0));
  EXPECT_EQ(value_of("dispersion.scale_factor_error.sensor_1_x.standard_deviation"),
            OwnCell(1.0 / 700.0));
  EXPECT_EQ(integer_of("SELECT value > 999 AND value / 3 > 333.3 FROM definition_entry WHERE key = "
                       "'estimation.transient_s'"),
            1);
  EXPECT_EQ(integer_of("SELECT count(*) FROM definition_entry WHERE value IS NULL"), 0);
  EXPECT_EQ(integer_of("SELECT count(DISTINCT key) = count(*) FROM definition_entry"), 1);
}

TEST_F(DefinitionTable, TakesTheNameOfItsCampaign) {
  make_file(varied_campaign());
  const auto all = rows_of("SELECT * FROM definition_entry");
  for (const std::string argument : {"('varied')", "('main')", "(NULL)"}) {
    EXPECT_EQ(rows_of("SELECT * FROM definition_entry" + argument), all) << argument;
  }
  EXPECT_EQ(rows_of("SELECT d.* FROM campaign AS c, definition_entry(c.name) AS d"), all);
  EXPECT_THAT(rows_of("SELECT DISTINCT campaign FROM definition_entry"),
              ElementsAre(ElementsAre(OwnCell("varied"))));
  EXPECT_THAT(error_of("SELECT * FROM definition_entry('hardy2013')"),
              HasSubstr("(definition_entry: campaign = hardy2013 (the database holds varied))"));
}

TEST_F(DefinitionTable, IsThatOfTheAttachedFile) {
  make_file(varied_campaign());
  MicroscopeCampaign other = campaign_of(2);
  other.scenario.noise.scale = 0.5;
  const auto path = directory() / "other.db";
  (void)coordinator::Store::create(path, other, canonical_definition(other));
  const coordinator::QueryFiles both(file(), {{"b", path}});
  const auto answer = [&](const std::string& sql) {
    RecordingWriter writer;
    EXPECT_EQ(coordinator::run_query(both, sql, {}, writer), coordinator::QueryEnd::complete);
    return writer.rows;
  };
  EXPECT_THAT(answer("SELECT a.value, b.value FROM definition_entry AS a JOIN "
                     "definition_entry('b') AS b USING (key) WHERE key IN ('noise.scale', "
                     "'campaign.name') ORDER BY key"),
              ElementsAre(ElementsAre(OwnCell("varied"), OwnCell("hardy2013")),
                          ElementsAre(OwnCell(1.0), OwnCell(0.5))));
  RecordingWriter writer;
  try {
    (void)coordinator::run_query(both, "SELECT * FROM b.definition_entry", {}, writer);
    ADD_FAILURE();
  } catch (const coordinator::QueryError& error) {
    EXPECT_THAT(error.what(), HasSubstr("(no such table: b.definition_entry; name the database in "
                                        "the argument, as in definition_entry('b'))"));
  }
}

TEST_F(DefinitionTable, SaysThatTheStoredDefinitionIsNoCampaign) {
  coordinator::Store::create(file(), campaign_of(2), "name = 1");
  EXPECT_THAT(error_of("SELECT * FROM definition_entry"),
              HasSubstr("(definition_entry: stored definition:1: name = 1 (unknown key"));
}

TEST_F(DefinitionTable, SaysWhichStoredValueIsNone) {
  for (const auto& [change, message] : std::map<std::string, std::string>{
           {"definition = replace(definition, 'transient_s = 1000', 'transient_s = -5')",
            "estimation.transient_s = -5 (must be "},
           {"name = 'other'", "campaign.name = other (must be varied, as in the definition)"}}) {
    std::filesystem::remove(file());
    make_file(varied_campaign());
    test::change(file(), "UPDATE campaign SET " + change);
    EXPECT_THAT(error_of("SELECT * FROM definition_entry"), HasSubstr(message));
  }
}

}  // namespace
}  // namespace proofmass::test
