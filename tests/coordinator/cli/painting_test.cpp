#include "coordinator/cli/painting.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "coordinator/archive/listing.hpp"
#include "coordinator/archive/verification.hpp"
#include "coordinator/cli/client_text.hpp"
#include "coordinator/cli/program.hpp"
#include "coordinator/store/store.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "tests/coordinator/cli/program.hpp"
#include "tests/coordinator/cli/pseudo_terminal.hpp"
#include "tests/coordinator/cli/temporary_directory.hpp"

namespace proofmass::coordinator {
namespace {

const std::string bad = "\033[1;38;5;130m";
const std::string good = "\033[1;38;5;31m";
const std::string bold = "\033[1m";
const std::string plain = "\033[0m";

/// The text without sequences that begin with ESC [ and end with m.
std::string unpainted(const std::string& text) {
  std::string result;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '\033') {
      i = text.find('m', i);
    } else {
      result += text[i];
    }
  }
  return result;
}

// The palette of xterm, and the contrast of two lights by WCAG 2.
double light_of(int colour) {
  const auto linear = [](int level) {
    const double value = (level == 0 ? 0.0 : 55.0 + 40.0 * level) / 255.0;
    return value <= 0.03928 ? value / 12.92 : std::pow((value + 0.055) / 1.055, 2.4);
  };
  const int cube = colour - 16;
  return 0.2126 * linear(cube / 36) + 0.7152 * linear(cube / 6 % 6) + 0.0722 * linear(cube % 6);
}

TEST(Tone, IsReadableOnBlackAndOnWhite) {
  for (const Tone tone : {Tone::good, Tone::bad}) {
    const double light = light_of(colour_of(tone));
    EXPECT_GT((light + 0.05) / 0.05, 4.0) << colour_of(tone);
    EXPECT_GT(1.05 / (light + 0.05), 4.0) << colour_of(tone);
  }
  EXPECT_EQ(colour_of(Tone::heading), 0) << "the terminal's own";
}

TEST(Painting, MarksCountsBeyondAnObjective) {
  const std::string table =
      "                             |error|        │  paper\n"
      "parameter          worst    mean    beyond │    std\n"
      "────────────────────────────────────────────┼───────\n"
      "a_c12               11.6    3.27         2 │    2.3\n"
      "a_c13               10.7    2.67         0 │    2.6\n"
      "k2d                    -       -         - │     23\n"
      "beyond: runs whose error exceeds the objective\n";
  const std::string text = painted(table);
  EXPECT_EQ(unpainted(text), table);
  EXPECT_NE(text.find("3.27         " + bad + "2" + plain + " │"), std::string::npos) << text;
  EXPECT_EQ(std::ranges::count(text, '\033'), 4) << "and the titles" << text;
  EXPECT_NE(text.find(bold + "parameter"), std::string::npos) << text;
}

TEST(Painting, MarksNoOtherLastColumnBeforeALine) {
  const std::string table =
      "parameter     std │    std\n"
      "──────────────────┼───────\n"
      "a_c12         2.3 │    2.3\n";
  EXPECT_EQ(painted(table), bold + "parameter     std │    std" + plain + table.substr(28));
}

TEST(Painting, MarksAnswers) {
  EXPECT_EQ(painted("Answer       met\n"), "Answer       " + good + "met" + plain + "\n");
  EXPECT_EQ(painted("Answer       not met\n"), "Answer       " + bad + "not met" + plain + "\n");
  EXPECT_EQ(painted("Answer       undecided\n"),
            "Answer       " + bad + "undecided" + plain + "\n");
}

TEST(Painting, MarksChecks) {
  const std::string passes = check_text(
      {.name = "digest", .verdict = Verdict::holds, .finding = "that of 32 runs", .details = {}});
  const std::string fails = check_text({.name = "digest",
                                        .verdict = Verdict::fails,
                                        .finding = "another one",
                                        .details = {"run 7"}});
  EXPECT_NE(painted(passes).find(good + "ok" + plain), std::string::npos) << painted(passes);
  EXPECT_NE(painted(fails).find(bad + "FAILS" + plain), std::string::npos) << painted(fails);
  EXPECT_EQ(unpainted(painted(passes)), passes);
  EXPECT_EQ(unpainted(painted(fails)), fails);
}

// Each text that is looked for is one that a command prints.
TEST(Painting, MarksWhatACoordinatorIsInTroubleWith) {
  wire::StatusReply status;
  wire::CampaignStatus campaign;
  campaign.name = "mine";
  campaign.storage_failure = "disk full";
  campaign.num_given_up = 2;
  campaign.num_without_estimate = 3;
  campaign.num_audited = campaign.num_mismatches = 1;
  status.campaigns = {campaign};
  status.unserved_files = {{.file = "b.db", .reason = "is damaged"}};
  status.quarantined_hosts = {"node7"};
  const std::string table = status_table(status, 79);
  const std::string text = painted(table);
  EXPECT_EQ(unpainted(text), table);
  for (const std::string line :
       {"mine: nothing can be stored: disk full", "mine: 2 runs given up: too many workers crashed",
        "mine: 3 runs without an estimate",
        "mine: 1 result compared with a second computation: 1 differ (none may)",
        "not served, tried again: is damaged",
        "host node7 is in quarantine: too many workers crashed there; `proofmass release node7`"}) {
    EXPECT_NE(text.find(bad + line + plain + "\n"), std::string::npos) << line << "\n" << text;
  }
}

TEST(Painting, MarksAFileThatCannotBeOpened) {
  const std::vector<ListedCampaign> campaigns{
      {.file = "b.db", .problem = "campaign database = b.db (is damaged)"}};
  const std::string text = painted(listing_text(campaigns, 80));
  EXPECT_NE(text.find(bad + "  campaign database = b.db (is damaged)" + plain), std::string::npos)
      << text;
}

TEST(Painting, MarksSignificantChanges) {
  const std::string table = "parameter     p\n────────────\na_c12      0.01 *   0.0.2 *\n\n* no\n";
  const std::string text = painted(table);
  EXPECT_EQ(unpainted(text), table);
  const std::string star = bold + "*" + plain;
  EXPECT_NE(text.find("0.01 " + star + "   0.0.2 " + star + "\n\n* no\n"), std::string::npos)
      << text;
}

TEST(Painting, LeavesOtherTextAlone) {
  for (const std::string text : {"", "\n", "Campaign  mine\nSeed      1\n", "no end", "│\n", "─"}) {
    EXPECT_EQ(painted(text), text);
  }
}

/// A terminal on which `report` prints a campaign.
class Terminal : public testing::Test {
 protected:
  Terminal() {
    const MicroscopeCampaign campaign = hardy2013_campaign();
    (void)Store::create(database_, campaign, canonical_definition(campaign));
  }

  [[nodiscard]] std::string shown() const {
    std::vector<std::string> arguments{"proofmass", "report", database_};
    std::vector<char*> argv;
    for (std::string& argument : arguments) argv.push_back(argument.data());
    test::PseudoTerminal terminal;
    EXPECT_EQ(run_proofmass(static_cast<int>(argv.size()), argv.data()), exit_done);
    return terminal.shown();
  }
  [[nodiscard]] std::string piped() const { return test::answer_of({"report", database_}).output; }

  const test::TemporaryDirectory directory_;
  const std::filesystem::path database_ = directory_ / "a.db";
  const test::Variable terminal_{"TERM", "xterm-256color"};
  const test::Variable no_color_{"NO_COLOR", nullptr};
};

TEST_F(Terminal, ShowsPaintedTables) {
  const std::string text = shown();
  EXPECT_NE(text.find(bold), std::string::npos) << text;
  EXPECT_EQ(unpainted(text), piped());
}

TEST_F(Terminal, ShowsNoColourWithNoColor) {
  const test::Variable no_color("NO_COLOR", "1");
  EXPECT_EQ(shown(), piped());
}

// https://no-color.org: "when present and not an empty string".
TEST_F(Terminal, IgnoresAnEmptyNoColor) {
  const test::Variable no_color("NO_COLOR", "");
  EXPECT_NE(shown(), piped());
}

TEST_F(Terminal, ShowsNoColourIfItHasNone) {
  for (const char* const name : {"dumb", "", static_cast<const char*>(nullptr)}) {
    const test::Variable terminal("TERM", name);
    EXPECT_EQ(shown(), piped());
  }
}

TEST_F(Terminal, IsNoPipe) { EXPECT_EQ(piped().find('\033'), std::string::npos); }

}  // namespace
}  // namespace proofmass::coordinator
