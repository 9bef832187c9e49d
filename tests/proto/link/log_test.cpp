#include "proto/link/log.hpp"

#include <gmock/gmock.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <memory>
#include <string>

namespace proofmass::wire {
namespace {

using namespace std::chrono_literals;

const std::chrono::system_clock::time_point noon =
    std::chrono::sys_days{std::chrono::year{2026} / 3 / 4} + 12h + 1234567us;

TEST(JsonLine, HasAFieldForEachPair) {
  EXPECT_EQ(
      json_line("worker_crashed signal=11 (Segmentation fault) restart_in_s=1.0", "error", noon),
      R"({"time":"2026-03-04T12:00:01.234Z","level":"error","event":"worker_crashed",)"
      R"json("signal":"11","restart_in_s":"1.0","text":"(Segmentation fault)"})json");
}

TEST(JsonLine, KeepsQuotedPartsTogether) {
  EXPECT_EQ(json_line("worker_ended reason=\"told to stop\"", "info", noon),
            R"({"time":"2026-03-04T12:00:01.234Z","level":"info","event":"worker_ended",)"
            R"("reason":"told to stop"})");
}

TEST(JsonLine, KeepsAQuoteThatNothingCloses) {
  EXPECT_EQ(json_line("malformed_message text=\"", "error", noon),
            R"({"time":"2026-03-04T12:00:01.234Z","level":"error","event":"malformed_message",)"
            R"("text":"\""})");
}

TEST(JsonLine, IsJsonWhateverAPeerSays) {
  EXPECT_EQ(json_line("malformed_message \xff\n\\ =x", "error", noon),
            R"({"time":"2026-03-04T12:00:01.234Z","level":"error","event":"malformed_message",)"
            "\"text\":\"\xef\xbf\xbd\\n\\\\ =x\"}");
}

TEST(JsonLine, KeepsWhatItSaysItselfWhateverAPeerSays) {
  EXPECT_EQ(json_line("refused name=\"a\" level=info time=never event=done name=b", "error", noon),
            R"({"time":"2026-03-04T12:00:01.234Z","level":"error","event":"refused",)"
            R"("name":"a","text":"level=info time=never event=done name=b"})");
}

/// Gives the program its former log back.
class SetUpLog : public testing::Test {
 protected:
  ~SetUpLog() override {
    spdlog::set_default_logger(former_);
    spdlog::set_level(spdlog::level::info);
  }

  /// What reaches standard error of an event worth knowing and of one that is wrong.
  static std::string written() {
    testing::internal::CaptureStderr();
    spdlog::info("worker_ended reason=told");
    spdlog::warn("worker_crashed signal=11");
    return testing::internal::GetCapturedStderr();
  }

 private:
  std::shared_ptr<spdlog::logger> former_ = spdlog::default_logger();
};

TEST_F(SetUpLog, WritesLinesForPeople) {
  set_up_log("people", LogFormat::text, LogLevel::info);
  EXPECT_THAT(written(), testing::MatchesRegex(
                             "[[][^\n]*[]] [[]people[]] [[]info[]] worker_ended reason=told\n"
                             "[[][^\n]*[]] [[]people[]] [[]warning[]] worker_crashed signal=11\n"));
}

TEST_F(SetUpLog, WritesAnObjectALineForPrograms) {
  set_up_log("programs", LogFormat::json, LogLevel::info);
  EXPECT_THAT(written(),
              testing::MatchesRegex(
                  R"([{]"time":"[^"]*","level":"info","event":"worker_ended","reason":"told"[}])"
                  "\n"
                  R"([{]"time":"[^"]*","level":"warning","event":"worker_crashed","signal":"11"[}])"
                  "\n"));
}

// A name from a file or a peer could steer the terminal, or look like an event of its own.
TEST_F(SetUpLog, MakesWhatFilesAndPeersSayVisible) {
  for (const LogFormat format : {LogFormat::text, LogFormat::json}) {
    set_up_log(format == LogFormat::text ? "visible text" : "visible json", format, LogLevel::info);
    testing::internal::CaptureStderr();
    spdlog::warn("refused name=\x1b[2J\n[2026] forged\xe2\x80\xae");
    const std::string text = testing::internal::GetCapturedStderr();
    EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1) << text;
    EXPECT_THAT(text, testing::HasSubstr("u001b[2J"));
    EXPECT_THAT(text, testing::HasSubstr("u202e"));
    EXPECT_EQ(text.find('\x1b'), std::string::npos);
    EXPECT_EQ(text.find("\xe2\x80\xae"), std::string::npos);
  }
}

TEST_F(SetUpLog, LeavesOutWhatIsBelowItsLevel) {
  set_up_log("quiet", LogFormat::text, LogLevel::warning);
  const std::string text = written();
  EXPECT_THAT(text, testing::Not(testing::HasSubstr("worker_ended")));
  EXPECT_THAT(text, testing::HasSubstr("worker_crashed"));
}

}  // namespace
}  // namespace proofmass::wire
