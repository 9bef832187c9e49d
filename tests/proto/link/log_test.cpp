#include "proto/link/log.hpp"

#include <nlohmann/json.hpp>

#include "core/error.hpp"
#include "proto/text/visible_text.hpp"
#include "tests/proto/link/scratch_directory.hpp"
#include "tests/proto/text/hostile_values.hpp"
#include "tests/test.hpp"

namespace proofmass::wire {
namespace {

const std::chrono::system_clock::time_point noon =
    std::chrono::sys_days{std::chrono::year{2026} / 3 / 4} + 12h + 1234567us;

TEST(JsonLine, HasAMemberForEachField) {
  EXPECT_EQ(json_line({.severity = Severity::error,
                       .kind = "worker_crashed",
                       .fields = {{"signal", 11U},
                                  Field::remark("(Segmentation fault)"),
                                  {"restart_in_s", 1.0},
                                  Field::reason("told to stop"),
                                  Field::remark("again")}},
                      noon),
            R"({"time":"2026-03-04T12:00:01.234Z","level":"error","event":"worker_crashed",)"
            R"("signal":11,"restart_in_s":1.0,"reason":"told to stop",)"
            R"json("text":"(Segmentation fault) again"})json");
  EXPECT_EQ(json_line({.severity = Severity::warning, .kind = "connected"}, noon),
            R"({"time":"2026-03-04T12:00:01.234Z","level":"warning","event":"connected"})");
}

TEST(JsonLine, HasTheValuesWhateverAFieldHolds) {
  for (const std::string_view hostile : test::hostile_values) {
    const std::string value(hostile);
    const std::string line =
        json_line({.kind = "refused",
                   .fields = {{"name", value}, Field::reason(value), Field::remark(value)}},
                  noon);
    const auto read = nlohmann::json::parse(line);
    const nlohmann::json expected{{"time", "2026-03-04T12:00:01.234Z"},
                                  {"level", "info"},
                                  {"event", "refused"},
                                  {"name", value},
                                  {"reason", value},
                                  {"text", value}};
    EXPECT_EQ(read, expected) << line;
    EXPECT_EQ(visible_text(line), line);
  }
}

TEST(JsonLine, IsJsonIfAPeerSaysWhatIsNotUtf8) {
  const auto read = nlohmann::json::parse(
      json_line({.kind = "malformed_message", .fields = {Field::remark("\xff\n\\ =x")}}, noon));
  EXPECT_EQ(read["text"], "\xef\xbf\xbd\n\\ =x");
}

/// What reaches standard error of an event worth knowing and of one that is wrong.
std::string written(const Log& log) {
  testing::internal::CaptureStderr();
  log({.kind = "worker_ended", .fields = {{"reason", "told"}}});
  log({.severity = Severity::warning, .kind = "worker_crashed", .fields = {{"signal", 11U}}});
  return testing::internal::GetCapturedStderr();
}

TEST(MakeLog, WritesLinesForPeople) {
  EXPECT_THAT(
      written(make_log("people", LogFormat::text, LogLevel::info)),
      testing::MatchesRegex("[[][^\n]*[]] [[]people[]] [[]info[]] worker_ended reason=told\n"
                            "[[][^\n]*[]] [[]people[]] [[]warning[]] worker_crashed signal=11\n"));
}

TEST(MakeLog, WritesAnObjectALineForPrograms) {
  EXPECT_THAT(written(make_log("programs", LogFormat::json, LogLevel::info)),
              testing::MatchesRegex(
                  R"([{]"time":"[^"]*","level":"info","event":"worker_ended","reason":"told"[}])"
                  "\n"
                  R"([{]"time":"[^"]*","level":"warning","event":"worker_crashed","signal":11[}])"
                  "\n"));
}

// A name from a file or a peer could steer the terminal, or look like an event of its own.
TEST(MakeLog, MakesWhatFilesAndPeersSayVisible) {
  for (const LogFormat format : {LogFormat::text, LogFormat::json}) {
    const Log log = make_log("visible", format, LogLevel::info);
    testing::internal::CaptureStderr();
    log({.kind = "refused", .fields = {{"name", "\x1b[2J\n[2026] forged\xe2\x80\xae"}}});
    const std::string text = testing::internal::GetCapturedStderr();
    EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1) << text;
    EXPECT_THAT(text, testing::HasSubstr("u001b[2J"));
    EXPECT_THAT(text, testing::HasSubstr("u202e"));
    EXPECT_EQ(text.find('\x1b'), std::string::npos);
    EXPECT_EQ(text.find("\xe2\x80\xae"), std::string::npos);
  }
}

TEST(MakeLog, LeavesOutWhatIsBelowItsLevel) {
  const std::string text = written(make_log("quiet", LogFormat::text, LogLevel::warning));
  EXPECT_THAT(text, testing::Not(testing::HasSubstr("worker_ended")));
  EXPECT_THAT(text, testing::HasSubstr("worker_crashed"));
}

}  // namespace
}  // namespace proofmass::wire
