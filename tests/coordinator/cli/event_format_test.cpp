#include "coordinator/cli/event_format.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace proofmass::coordinator {
namespace {

const std::chrono::system_clock::time_point moment{std::chrono::milliseconds(1'700'000'000'123)};

TEST(JsonLine, HasAFieldForEachPair) {
  const Event event{.severity = Severity::warning,
                    .kind = "runs_lost",
                    .text = "worker=7 runs=120..183 reason=\"no word = too long\""};
  EXPECT_EQ(json_line(event, moment),
            R"({"time":"2023-11-14T22:13:20.123Z","level":"warning","event":"runs_lost",)"
            R"("worker":"7","runs":"120..183","reason":"no word = too long"})");
}

TEST(JsonLine, KeepsWhatIsNoPairAsText) {
  const Event event{.severity = Severity::error, .kind = "odd", .text = "what a=1 is =this"};
  const auto line = nlohmann::json::parse(json_line(event, moment));
  EXPECT_EQ(line["text"], "what is =this");
  EXPECT_EQ(line["a"], "1");
  EXPECT_EQ(line["level"], "error");
}

TEST(JsonLine, IsOneLineOfJsonWhateverTheTextHolds) {
  const Event event{.kind = "odd", .text = "key=\"a\nb\xff\" \"open"};
  const std::string text = json_line(event, moment);
  EXPECT_EQ(text.find('\n'), std::string::npos);
  const auto line = nlohmann::json::parse(text);
  EXPECT_EQ(line["level"], "info");
  EXPECT_EQ(line["text"], "\"open");
}

}  // namespace
}  // namespace proofmass::coordinator
