// Definitions that no program writes. Each must be refused in words, at a cost in proportion to its
// size: the sizes here are such that another cost would show as a crash or as minutes.

#include <fmt/format.h>

#include "core/microscope/definition/campaign_definition.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

std::string refusal_of(Definition definition, TableColumns columns = TableColumns::included) {
  return test::message_of<Error>([&] { (void)campaign_of(std::move(definition), columns); });
}

std::string refusal_of_text(const std::string& text) { return refusal_of({.text = text}); }

/// Why the definition is refused after one text in it was replaced by another.
std::string refusal_after(const std::string& from, const std::string& to) {
  Definition definition = definition_of(MicroscopeCampaign{});
  const std::size_t position = definition.text.find(from);
  EXPECT_NE(position, std::string::npos) << from;
  definition.text.replace(position, from.size(), to);
  return refusal_of(std::move(definition));
}

std::string repeated(const std::string& text, int count) {
  std::string result;
  for (int i = 0; i < count; ++i) result += text;
  return result;
}

MicroscopeCampaign campaign_with_data() {
  MicroscopeCampaign campaign;
  campaign.num_runs = 2;
  campaign.scenario.environment.kind = EnvironmentKind::file;
  campaign.environment_file = "e.csv";
  campaign.environment_table = {{0.0, {1, 2, 3}, {4, 5, 6}}, {6000.0, {1, 2, 3}, {4, 5, 6}}};
  campaign.dispersions[5] = {.law = Law::table, .file = "f.csv", .column = "a"};
  campaign.table_columns = {{1e-3, 2e-3}};
  return campaign;
}

TEST(HostileDefinition, IsNoToml) {
  EXPECT_EQ(refusal_of_text("a = = 1").substr(0, 14), "definition:1: ");
  EXPECT_EQ(refusal_of_text("a = \"\xff\"").substr(0, 14), "definition:1: ");
  EXPECT_EQ(refusal_of_text(std::string(1000, '\0')).substr(0, 14), "definition:1: ");
}

TEST(HostileDefinition, IsNested) {
  const std::string rule =
      " nesting = over 16 (parts of a key, and lists and tables in one another, must be at most "
      "16)";
  EXPECT_EQ(refusal_of_text(repeated("a.", 500'000) + "a = 1"), "definition:1:" + rule);
  EXPECT_EQ(refusal_of_text(std::string("\n[") + repeated("a.", 500'000) + "a]"),
            "definition:2:" + rule);
  EXPECT_EQ(refusal_of_text(repeated("\"\".", 300'000) + "a = 1"), "definition:1:" + rule);
  EXPECT_EQ(refusal_of_text(std::string("a = ") + repeated("{a.a.a = ", 100'000)),
            "definition:1:" + rule);
  EXPECT_EQ(refusal_of_text(std::string("a = ") + std::string(1'000'000, '[')),
            "definition:1:" + rule);
}

TEST(HostileDefinition, HasManyOfEverything) {
  EXPECT_EQ(refusal_of_text(repeated("[[session]]\n", 80'000)),
            "definition:1: session = 80000 tables (must be at most 64)");
  EXPECT_EQ(refusal_of_text(
                std::string("[[session]]\nname = \"a\"\ntarget = \"a_c12\"\nexcitations = [") +
                repeated("{},", 300'000) + "]"),
            "definition:4: session[0].excitations = 300000 tables (must be at most 16)");
  EXPECT_EQ(
      refusal_of_text(std::string("[[session]]\nname = \"a\"\ntarget = \"a_c12\"\nfit_lines = [") +
                      repeated("[1,2],", 160'000) + "]"),
      "definition:4: session[0].fit_lines = a list (must have at most 64 entries)");
}

TEST(HostileDefinition, HasManyKeysOfALongName) {
  const std::string name(500'000, 'a');
  const std::string text = refusal_of_text(std::string("[") + name + "]\n" + [] {
    std::string keys;
    for (int i = 0; i < 80'000; ++i) keys += fmt::format("b{}=1\n", i);
    return keys;
  }());
  EXPECT_EQ(text, fmt::format("definition:1: {:.200}... = a table (unknown key)", name));
  EXPECT_EQ(refusal_of_text(name + name + " = 1"),
            fmt::format("definition:1: {:.200}... = 1 (unknown key)", name));
}

TEST(HostileDefinition, HasLongTexts) {
  const std::string large(900'000, 'x');
  EXPECT_LT(refusal_after("name = \"hardy2013\"", "name = \"" + large + "\"").size(), 300U);
  EXPECT_LT(refusal_after("law = \"uniform\", minimum = -0.01, maximum = 0.01",
                          "law = \"table\", file = \"" + large + "\", column = \"a\"")
                .size(),
            300U);
  EXPECT_LT(refusal_after("[environment]\n", "[environment]\nfile = \"" + large + "\"\n").size(),
            300U);
}

TEST(HostileDefinition, BreaksARule) {
  EXPECT_EQ(refusal_after("\nscale = 1\n", "\nscale = nan\n").substr(0, 11), "definition:");
  EXPECT_NE(refusal_after("num_rounds_max = ", "num_rounds_max = 1.5 #").find("whole number"),
            std::string::npos);
  EXPECT_NE(refusal_after("maximum = 0.01", "maximum = inf").find("maximum = inf (must be finite)"),
            std::string::npos);
  EXPECT_NE(refusal_after("name = \"hardy2013\"", "name = \"../a\"")
                .find("campaign.name = \"../a\" (must be 1 to 64 of [A-Za-z0-9._-], a letter or "
                      "digit first)"),
            std::string::npos);
  EXPECT_NE(refusal_after("runs = 100", "runs = 1000000001").find("campaign.runs = 1000000001"),
            std::string::npos);
}

// Two texts for one campaign would be two definitions of it.
TEST(HostileDefinition, IsNotCanonical) {
  const std::string rule = ", as the definition has one spelling)";
  EXPECT_EQ(refusal_after("runs = 100", "runs =  100"),
            "definition:4: line = \"runs =  100\" (must be \"runs = 100\"" + rule);
  EXPECT_EQ(refusal_after("seed = 1\nruns = 100", "runs = 100\nseed = 1"),
            "definition:3: line = \"runs = 100\" (must be \"seed = 1\"" + rule);
  EXPECT_EQ(refusal_after("seed = 1\n", ""),
            "definition:3: line = \"runs = 100\" (must be \"seed = 1\"" + rule);
  EXPECT_EQ(refusal_of_text(""), "definition:1: line = \"\" (must be \"[campaign]\"" + rule);
  EXPECT_EQ(refusal_after("runs = 100\n", "runs = 100\r\n"),
            "definition:4: line = \"runs = 100\\u000D\" (must be \"runs = 100\"" + rule);
  Definition definition = definition_of(MicroscopeCampaign{});
  definition.text += "# more";
  EXPECT_NE(refusal_of(definition).find("line = \"# more\" (must be \"\"" + rule),
            std::string::npos);
}

TEST(HostileDefinition, HasOtherTables) {
  const auto refusal = [](const std::function<void(Definition&)>& change) {
    Definition definition = definition_of(campaign_with_data());
    EXPECT_EQ(refusal_of(definition), "");
    change(definition);
    return refusal_of(std::move(definition));
  };
  EXPECT_EQ(refusal([](Definition& d) { d.tables.clear(); }),
            "definition:6: environment.file = 0 rows (must have 2 to 200000)");
  EXPECT_EQ(refusal([](Definition& d) { d.tables[0].key = "noise.file"; }),
            "definition.tables = noise.file (must be environment.file alone)");
  EXPECT_EQ(refusal([](Definition& d) { d.tables.push_back(d.tables[0]); }),
            "definition.tables = environment.file, ... (must be environment.file alone)");
  EXPECT_EQ(refusal([](Definition& d) { d.tables[0].num_columns = 2; }),
            "definition.tables = 14 values in 2 columns (must be rows of 7)");
  EXPECT_EQ(refusal([](Definition& d) { d.tables[0].values.pop_back(); }),
            "definition.tables = 13 values in 7 columns (must be rows of 7)");
  EXPECT_EQ(refusal([](Definition& d) { d.tables[0].values[8] = nan; }),
            "definition:5: environment.file row 2 = nan (must be finite)");
  EXPECT_EQ(refusal([](Definition& d) { d.table_columns.clear(); }),
            "definition:235: dispersion = 0 columns (laws of kind table are 1)");
  EXPECT_NE(refusal([](Definition& d) {
              d.table_columns[0].pop_back();
            }).find("has values for 1 runs, 2 are needed"),
            std::string::npos);
  EXPECT_NE(
      refusal([](Definition& d) { d.table_columns[0][1] = nan; }).find("row 2 must be finite"),
      std::string::npos);
}

TEST(HostileDefinition, HasATableThatNothingNames) {
  Definition definition = definition_of(MicroscopeCampaign{});
  definition.tables = definition_of(campaign_with_data()).tables;
  EXPECT_EQ(refusal_of(definition),
            "definition:11: environment.file = \"\" (only with environment.kind = \"file\")");
}

TEST(HostileDefinition, HasColumnsThatComeWithTheRuns) {
  const MicroscopeCampaign campaign = campaign_with_data();
  EXPECT_EQ(refusal_of(definition_of(campaign), TableColumns::left_out),
            "definition.table_columns = 1 of them (must be none, as they come with the runs)");
  EXPECT_EQ(refusal_of(definition_of(campaign, TableColumns::left_out), TableColumns::left_out),
            "");
}

}  // namespace
}  // namespace proofmass
