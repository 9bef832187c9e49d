#include "coordinator/cli/output.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "coordinator/cli/program.hpp"
#include "coordinator/store/store.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "tests/coordinator/cli/program.hpp"
#include "tests/coordinator/cli/pseudo_terminal.hpp"
#include "tests/coordinator/cli/temporary_directory.hpp"

namespace proofmass::coordinator {
namespace {

const std::string bold = "\033[1m";

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
