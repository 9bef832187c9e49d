#include "coordinator/net/authentication/refusal_log.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <string>
#include <vector>

namespace proofmass::coordinator {
namespace {

class RefusalLogTest : public ::testing::Test {
 protected:
  void refuse(const std::string& key, std::chrono::seconds at, const std::string& address = "") {
    log_.refused(
        {.domain = "workers", .address = address, .public_key = key, .reason = "unknown key"},
        RefusalLog::TimePoint{} + at);
  }

  std::vector<Event> events_;
  RefusalLog log_{[this](Event event) { events_.push_back(std::move(event)); }};
};

using std::chrono::seconds;

TEST_F(RefusalLogTest, WritesAddressesPlainly) {
  refuse("KEY", seconds(0), "::ffff:10.0.0.7");
  refuse("KEY", seconds(0), "::ffff:1");
  refuse("", seconds(0));
  ASSERT_EQ(events_.size(), 3u);
  EXPECT_EQ(events_[0].kind, "peer_refused");
  EXPECT_EQ(events_[0].severity, Severity::warning);
  EXPECT_EQ(to_text(events_[0].fields),
            "domain=workers address=10.0.0.7 key=KEY reason=\"unknown key\"");
  EXPECT_EQ(to_text(events_[1].fields),
            "domain=workers address=::ffff:1 key=KEY reason=\"unknown key\"");
  EXPECT_EQ(to_text(events_[2].fields),
            "domain=workers address=unknown key=none reason=\"unknown key\"");
}

TEST_F(RefusalLogTest, SaysTheSameOnceAMinute) {
  refuse("KEY", seconds(1));
  refuse("KEY", seconds(60));
  EXPECT_EQ(events_.size(), 1u);
  refuse("KEY", seconds(61));
  EXPECT_EQ(events_.size(), 2u);
}

TEST_F(RefusalLogTest, CountsAFlood) {
  for (int i = 0; i < 1000; ++i) refuse("KEY" + std::to_string(i), seconds(1));
  EXPECT_EQ(events_.size(), 20u);
  refuse("KEY", seconds(100));
  ASSERT_EQ(events_.size(), 22u);
  EXPECT_EQ(events_[20].kind, "peers_refused");
  EXPECT_EQ(to_text(events_[20].fields), "count=980 without a line each");
}

}  // namespace
}  // namespace proofmass::coordinator
