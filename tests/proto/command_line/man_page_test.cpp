#include "proto/command_line/man_page.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "tests/coordinator/cli/temporary_directory.hpp"
#include "tests/proto/command_line/example_program.hpp"
#include "tests/proto/command_line/shell.hpp"
#include "tests/skip_for_want.hpp"

namespace proofmass::wire {
namespace {

using testing::HasSubstr;
using testing::Not;

/// The page as a reader sees it, with the warnings of groff.
std::string formatted(const std::string& page) {
  const test::TemporaryDirectory directory;
  std::ofstream(directory / "page.1") << page;
  return test::shell_answer("groff -man -Tascii -ww -P-cbou -rLL=200n " +
                            (directory / "page.1").string())
      .output;
}

class ManPage : public testing::Test {
 protected:
  void SetUp() override {
    if (!test::has_program("groff")) return test::skip_for_want("groff is not installed");
    text_ = formatted(man_page(test::ExampleProgram().described(), "space-probe 1.2", {"b-c"}));
  }

  std::string text_;
};

TEST_F(ManPage, ShowsTextsAsTheyAre) {
  EXPECT_THAT(text_, Not(HasSubstr("warning")));
  for (const char* part :
       {"Sends data. .And more.", "Send it's \"data\": [all], C:\\a $HOME ~ ^ | `x`.",
        ".dots and 'quotes' first.", "A\\B; %d -- 100 %.", "'''.",
        "File with [options], as in `a = \"b\"`."}) {
    EXPECT_THAT(text_, HasSubstr(part));
  }
}

TEST_F(ManPage, HasTheSectionsThatApply) {
  for (const char* section : {"NAME", "SYNOPSIS", "DESCRIPTION", "OPTIONS", "COMMANDS",
                              "EXIT STATUS", "ENVIRONMENT", "SEE ALSO"}) {
    EXPECT_THAT(text_, HasSubstr(std::string("\n") + section + "\n"));
  }
  EXPECT_THAT(text_, HasSubstr("space-probe - Sends data\n"));
  EXPECT_THAT(text_, HasSubstr("space-probe [OPTIONS] COMMAND ...\n"));
  EXPECT_THAT(text_, HasSubstr("space-probe send [OPTIONS] DB [PART ...]\n"));
  EXPECT_THAT(text_, HasSubstr("b-c(1)"));
  const std::string plain =
      formatted(man_page(described_program(CLI::App("Does.", "a")), "a 1", {}));
  for (const char* section : {"COMMANDS", "EXIT STATUS", "ENVIRONMENT", "SEE ALSO"}) {
    EXPECT_THAT(plain, Not(HasSubstr(section)));
  }
}

TEST_F(ManPage, TellsAllThatADeclarationKnows) {
  EXPECT_THAT(text_, HasSubstr("-c, --config FILE\n"));
  EXPECT_THAT(text_, HasSubstr("--runs INT\n"));
  // Groff puts two spaces between sentences.
  EXPECT_THAT(text_,
              HasSubstr("Number of runs; e.g. 5.  Must be in [1, 9].  The default is 3.  Can "
                        "come from the environment variable PROBE_RUNS.\n"));
  EXPECT_THAT(text_, HasSubstr(".dots and 'quotes' first.  Must be given.\n"));
  EXPECT_THAT(text_, HasSubstr("--format $HOME's|json|two words\n"));
  EXPECT_THAT(text_, HasSubstr("Exit status: 0.\n"));
  EXPECT_THAT(text_, HasSubstr("130    interrupted; 'what is stored' stands.\n"));
  EXPECT_THAT(text_, HasSubstr("Value of --config.\n"));
  EXPECT_THAT(text_, HasSubstr("Value of --runs of send.\n"));
  EXPECT_THAT(text_, Not(HasSubstr("secret")));
  EXPECT_THAT(text_, Not(HasSubstr("internal")));
}

}  // namespace
}  // namespace proofmass::wire
