#include "proto/command_line/manual_option.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "core/error.hpp"
#include "tests/coordinator/cli/temporary_directory.hpp"
#include "tests/proto/command_line/example_program.hpp"

namespace proofmass::wire {
namespace {

class ManualOption : public testing::Test {
 protected:
  ManualOption() { add_manual_option(program_.app, {}); }

  test::ExampleProgram program_;
  const test::TemporaryDirectory directory_;
};

TEST_F(ManualOption, WritesAllFilesAndEndsTheProgramAsHelpDoes) {
  EXPECT_THROW(program_.app.parse("--write-manual " + (directory_ / "share").string()),
               CLI::Success);
  for (const char* file :
       {"man/man1/space-probe.1", "bash-completion/completions/space-probe",
        "zsh/site-functions/_space-probe", "fish/vendor_completions.d/space-probe.fish"}) {
    EXPECT_GT(std::filesystem::file_size(directory_ / "share" / file), 0U) << file;
  }
}

TEST_F(ManualOption, IsHidden) {
  EXPECT_EQ(program_.app.help().find("write-manual"), std::string::npos);
  EXPECT_EQ(program_.described().options.size(), 3U);
}

TEST_F(ManualOption, NamesAFileThatCannotBeWritten) {
  std::ofstream(directory_ / "share") << "";
  try {
    program_.app.parse("--write-manual " + (directory_ / "share").string());
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.what(), "manual = " + (directory_ / "share/man/man1/space-probe.1").string() +
                                " (Not a directory)");
  }
}

}  // namespace
}  // namespace proofmass::wire
