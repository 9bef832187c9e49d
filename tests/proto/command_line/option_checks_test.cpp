#include "proto/command_line/option_checks.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <map>
#include <string>

namespace proofmass::wire {
namespace {

TEST(InRange, TakesBothEndsAndWhatIsBetween) {
  const CLI::Validator check = in_range(std::uint64_t{1}, std::uint64_t{1024});
  for (const char* text : {"1", "17", "1024"}) EXPECT_EQ(check(text), "") << text;
  EXPECT_EQ(in_range(0.0, 1.0)("0.25"), "");
  EXPECT_EQ(in_range(0.0, 1.0)("1e-3"), "");
  EXPECT_EQ(in_range(-5, 5)("-5"), "");
}

TEST(InRange, RefusesOthersWithTheRule) {
  const CLI::Validator check = in_range(std::uint64_t{0}, std::uint64_t{1024});
  EXPECT_EQ(check("1025"), "1025 (must be in [0, 1024])");
  for (const std::string text :
       {"-1", "18446744073709551617", "1.5", "1e3", "0x10", "one", "7 ", ""}) {
    EXPECT_EQ(check(text), text + " (must be a whole number in [0, 1024])");
  }
  for (const std::string text : {"-0.001", "1.001", "nan", "inf", "half"}) {
    EXPECT_EQ(in_range(0.0, 1.0)(text), text + " (must be in [0, 1])");
  }
}

TEST(OneOf, NamesTheWordsThatItTakes) {
  const CLI::Validator check = one_of({"csv", "json"});
  EXPECT_EQ(check("json"), "");
  EXPECT_EQ(check("xml"), "xml (must be one of csv, json)");
  EXPECT_EQ(check("JSON"), "JSON (must be one of csv, json)");
}

/// What a program with `run --runs N` and `report` says of these arguments.
std::string refusal(const std::string& arguments) {
  CLI::App app("", "program");
  app.require_subcommand(1);
  std::uint64_t num_runs = 0;
  std::string first, second;
  app.add_subcommand("run", "")->add_option("--runs", num_runs, "");
  app.add_subcommand("report", "");
  CLI::App* const query = app.add_subcommand("query", "");
  query->add_option("DB", first, "")->required();
  query->add_option("SQL", second, "")->required();
  CLI::App* const tag = app.add_subcommand("tag", "");
  tag->add_option("DB", first, "")->required();
  tag->add_option("ACTION", second, "");
  try {
    app.parse(arguments);
  } catch (const CLI::ParseError& error) {
    return refusal_of(app, error);
  }
  return {};
}

TEST(Refusal, NamesTheNearestCommandAndOption) {
  EXPECT_EQ(refusal("raport"),
            "command = raport (must be one that --help lists; nearest is report)");
  EXPECT_EQ(refusal("run --rnus 3"),
            "option = --rnus (must be one that --help lists; nearest is --runs)");
  EXPECT_EQ(refusal("run --rnus=3"),
            "option = --rnus=3 (must be one that --help lists; nearest is --runs)");
}

TEST(Refusal, SaysThatACommandIsMissing) {
  EXPECT_EQ(refusal(""), "command = none (must be one that --help lists)");
}

TEST(Refusal, NamesNoneIfNoneIsNear) {
  EXPECT_EQ(refusal("simulate"), "command = simulate (must be one that --help lists)");
  EXPECT_EQ(refusal("run --database"), "option = --database (must be one that --help lists)");
  EXPECT_EQ(refusal("report more"),
            "argument = more (not expected; usage: program report [OPTIONS])");
}

TEST(Refusal, ShowsWhatWasTakenForWhichArgument) {
  EXPECT_EQ(refusal("tag 13 add a.db"),
            "argument = a.db (not expected after DB = 13, ACTION = add; "
            "usage: program tag [OPTIONS] DB [ACTION])");
  EXPECT_EQ(refusal("query a b c d"),
            "arguments = c d (not expected after DB = a, SQL = b; "
            "usage: program query [OPTIONS] DB SQL)");
}

TEST(Refusal, NamesAnUnknownOptionBeforeAMissingArgument) {
  EXPECT_EQ(refusal("query --runs"), "option = --runs (must be one that --help lists)");
  EXPECT_EQ(refusal("query"), "DB is required; usage: program query [OPTIONS] DB SQL");
  EXPECT_EQ(refusal("query a"), "SQL is required; usage: program query [OPTIONS] DB SQL");
}

TEST(Refusal, SaysThatAnOptionLacksItsValue) {
  EXPECT_EQ(refusal("run --runs"), "option = --runs (needs a value behind it)");
}

TEST(Choice, SetsTheValueOfItsWord) {
  const std::map<std::string, int> choices{{"low", 1}, {"high", 2}};
  int level = 0;
  CLI::App app;
  add_choice(app, "--level", level, choices, "");
  app.parse("--level high");
  EXPECT_EQ(level, 2);
  EXPECT_THROW(app.parse("--level middle"), CLI::ValidationError);
}

}  // namespace
}  // namespace proofmass::wire
