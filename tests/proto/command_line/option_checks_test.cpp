#include "proto/command_line/option_checks.hpp"

#include "tests/proto/link/scratch_directory.hpp"
#include "tests/test.hpp"

namespace proofmass::wire {
namespace {

TEST(InRange, TakesBothEndsAndWhatIsBetween) {
  const CLI::Validator check = in_range(std::uint64_t{1}, std::uint64_t{1024});
  for (const char* text : {"1", "17", "1024"}) EXPECT_EQ(check(text), "") << text;
  EXPECT_EQ(in_range(0.0, 1.0)("0.25"), "");
  EXPECT_EQ(in_range(0.0, 1.0)("1e-3"), "");
  EXPECT_EQ(in_range(-5, 5)("-5"), "");
}

TEST(OneOf, NamesTheWordsThatItTakes) {
  const CLI::Validator check = one_of({"csv", "json"});
  EXPECT_EQ(check("json"), "");
  EXPECT_EQ(check("xml"), "xml (must be one of csv, json)");
  EXPECT_EQ(check("JSON"), "JSON (must be one of csv, json)");
}

TEST(DurationFrom, KnowsUnits) {
  EXPECT_EQ(duration_from("90"), 90s);
  EXPECT_EQ(duration_from("90s"), 90s);
  EXPECT_EQ(duration_from("15m"), 15min);
  EXPECT_EQ(duration_from("2h"), 2h);
  EXPECT_EQ(duration_from("366d"), 24h * 366);
}

TEST(DurationFrom, RefusesWhatIsNoTime) {
  for (const char* const text : {"", "0", "-1", "1.5h", "h", "1 h", "1H", "367d", "1h30m",
                                 "99999999999999999999", "9999999999999999d", " 1"}) {
    EXPECT_EQ(duration_from(text), std::nullopt) << text;
  }
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

/// What a program with `watch --connect`, a hidden option and `list` says of this option file,
/// which is FILE then.
std::string refusal_of_file(const std::string& content) {
  const test::ScratchDirectory directory;
  const std::string file = directory / "options.toml";
  test::write_text(file, content, 0644);
  CLI::App app("", "program");
  app.set_config("--config");
  app.allow_config_extras(CLI::config_extras_mode::error);
  std::string endpoint;
  CLI::App* const watch = app.add_subcommand("watch", "");
  watch->add_option("--connect", endpoint, "");
  watch->add_option("--conec", endpoint, "")->group("");
  app.add_subcommand("list", "");
  std::string text;
  try {
    app.parse("--config " + file);
  } catch (const CLI::ParseError& error) {
    text = refusal_of(app, error);
  }
  if (const std::size_t place = text.find(file); place != text.npos) {
    text.replace(place, file.size(), "FILE");
  }
  return text;
}

TEST(OptionFile, IsRefusedWithTheLineAndTheNearestName) {
  EXPECT_EQ(refusal_of_file("[list]\n\n[watch]\n# mine\nconect = \"ipc:///a\"\n"),
            "config = FILE:5 (watch.conect is no option; nearest is connect)");
  EXPECT_EQ(refusal_of_file("watch.conect = \"ipc:///a\"\n"),
            "config = FILE:1 (watch.conect is no option; nearest is connect)");
  EXPECT_EQ(refusal_of_file("\n[wach]\nconnect = \"ipc:///a\"\n"),
            "config = FILE:2 ([wach] is no command; nearest is watch)");
  EXPECT_EQ(refusal_of_file("connect = \"ipc:///a\"\n"), "config = FILE:1 (connect is no option)");
  EXPECT_EQ(refusal_of_file("[watch]\nconnect to a\n"),
            "config = FILE:2 (watch.connect to a is no option)");
}

TEST(OptionFile, IsRefusedIfASectionIsNotClosed) {
  EXPECT_EQ(refusal_of_file("[watch\nconnect = \"ipc:///a\"\n"),
            "config = FILE:1 ([watch has no ])");
}

/// The value of `--level` by these arguments and a variable that names the file; or why they are
/// refused.
std::string level_by(const std::string& variable, const std::string& arguments) {
  setenv("PROOFMASS_TEST_CONFIG", variable.c_str(), 1);
  CLI::App app("", "program");
  add_option_file(app, "", "PROOFMASS_TEST_CONFIG");
  std::string level = "none";
  app.add_option("--level", level, "");
  try {
    app.parse(arguments);
  } catch (const CLI::ParseError& error) {
    level = refusal_of(app, error);
  }
  unsetenv("PROOFMASS_TEST_CONFIG");
  return level;
}

TEST(OptionFile, IsNamedByAVariableUnlessAnArgumentNamesIt) {
  const test::ScratchDirectory directory;
  const std::string first = directory / "first.toml", second = directory / "second.toml";
  test::write_text(first, "level = \"1\"\n", 0644);
  test::write_text(second, "level = \"2\"\n", 0644);
  EXPECT_EQ(level_by("", ""), "none");
  EXPECT_EQ(level_by(first, ""), "1");
  EXPECT_EQ(level_by(first, "--config " + second), "2");
  EXPECT_EQ(level_by(first, "--level 3"), "3");
  EXPECT_EQ(level_by("nowhere.toml", ""), "config = nowhere.toml (cannot be read)");
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
