// What the programs write to a terminal.

#include <gtest/gtest.h>

#include <string>

#include "tests/system/campaign_process.hpp"

namespace proofmass::test {
namespace {

class OnATerminal : public CampaignProcess {
 protected:
  /// What `run` shows on a terminal, by script(1).
  [[nodiscard]] std::string shown(const std::string& name, const std::string& environment) const {
    const std::string command = "env -u TERM " + environment + " " + programs +
                                "/proofmass run short.toml --runs 4 --db " + name + ".db";
    Process script(directory / "", name, "/usr/bin/script",
                   {"--quiet", "--return", "--command", command, "/dev/null"});
    EXPECT_EQ(script.wait(), 0);
    return read_file(path(name + ".out"));
  }
};

TEST_F(OnATerminal, ProgressIsDrawnOverTheLineBefore) {
  EXPECT_TRUE(contains(shown("bar", "TERM=xterm"), "\r4/4 runs ["));
}

TEST_F(OnATerminal, NoControlSequenceIsSentToOneThatKnowsNone) {
  for (const std::string environment : {"TERM=dumb", "TERM="}) {
    const std::string text = shown("plain", environment + " NO_COLOR=1");
    EXPECT_FALSE(contains(text, "\033")) << environment << text;
    EXPECT_TRUE(contains(text, "4/4 runs  100 %")) << text;
    std::filesystem::remove(path("plain.db"));
  }
}

}  // namespace
}  // namespace proofmass::test
