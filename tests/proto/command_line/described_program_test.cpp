#include "proto/command_line/described_program.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/proto/command_line/example_program.hpp"

namespace proofmass::wire {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

std::vector<std::string> names_of(const std::vector<DescribedOption>& options) {
  std::vector<std::string> names;
  for (const DescribedOption& option : options) names.push_back(option.names.back());
  return names;
}

TEST(DescribedProgram, HoldsWhatIsVisibleInItsOrder) {
  const DescribedCommand program = test::ExampleProgram().described();
  EXPECT_EQ(program.name, "space-probe");
  EXPECT_EQ(program.text, "Sends data. .And more.");
  EXPECT_THAT(names_of(program.options), ElementsAre("--help", "--version", "--config"));
  ASSERT_EQ(program.commands.size(), 2U);
  const DescribedCommand& send = program.commands.front();
  EXPECT_EQ(send.name, "send");
  EXPECT_THAT(names_of(send.arguments), ElementsAre("DB", "PART"));
  EXPECT_THAT(names_of(send.options),
              ElementsAre("--help", "--format", "--runs", "--set", "--keys", "--force"));
}

TEST(DescribedProgram, TellsWhatAnOptionTakes) {
  const DescribedCommand send = test::ExampleProgram().described().commands.front();
  const auto& options = send.options;
  EXPECT_EQ(options[0].kind, ValueKind::none);
  EXPECT_EQ(options[1].kind, ValueKind::word);
  EXPECT_THAT(options[1].words, ElementsAre("$HOME's", "json", "two words"));
  EXPECT_EQ(options[2].kind, ValueKind::text);
  EXPECT_EQ(options[2].range, "[1, 9]");
  EXPECT_EQ(options[2].default_value, "3");
  EXPECT_EQ(options[2].variable, "PROBE_RUNS");
  EXPECT_FALSE(options[2].is_repeatable);
  EXPECT_TRUE(options[3].is_repeatable);
  EXPECT_EQ(options[4].kind, ValueKind::directory);
  EXPECT_EQ(options[5].kind, ValueKind::none);
  EXPECT_EQ(send.arguments[0].kind, ValueKind::file);
  EXPECT_EQ(send.arguments[0].extension, ".db");
  EXPECT_TRUE(send.arguments[0].is_required);
  EXPECT_FALSE(send.arguments[1].is_required);
  EXPECT_TRUE(send.arguments[1].is_repeatable);
}

TEST(DescribedProgram, ReadsExitCodesFromTheFooter) {
  const DescribedCommand program = test::ExampleProgram().described();
  ASSERT_EQ(program.exits.size(), 2U);
  EXPECT_EQ(program.exits[1].code, "130");
  EXPECT_EQ(program.exits[1].text, "interrupted; 'what is stored' stands");
  EXPECT_EQ(program.commands.front().exits.size(), 1U);
  EXPECT_THAT(described_program(CLI::App("", "a")).exits, IsEmpty());
}

}  // namespace
}  // namespace proofmass::wire
