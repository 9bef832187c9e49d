#include "proto/link/log.hpp"

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace proofmass::wire
