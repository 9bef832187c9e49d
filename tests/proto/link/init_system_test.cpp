#include "proto/link/init_system.hpp"

#include <gtest/gtest.h>

#include <cstdlib>

#include "tests/proto/link/notice_receiver.hpp"
#include "tests/proto/link/scratch_directory.hpp"

namespace proofmass::wire {
namespace {

using namespace std::chrono_literals;

TEST(InitSystem, IsToldThroughItsSocket) {
  const test::ScratchDirectory directory;
  const std::string path = (directory / "notify").string();
  const test::NoticeReceiver receiver(path);
  const InitSystem init_system(path, std::nullopt);
  init_system.notify("READY=1");
  EXPECT_EQ(receiver.receive(), "READY=1");
}

TEST(InitSystem, MayHaveAnAbstractSocket) {
  const std::string name = "@proofmass-test-" + std::to_string(getpid());
  const test::NoticeReceiver receiver(name);
  InitSystem(name, std::nullopt).notify("STOPPING=1");
  EXPECT_EQ(receiver.receive(), "STOPPING=1");
}

TEST(InitSystem, NeedNotBeThere) {
  InitSystem("", std::nullopt).notify("READY=1");
  InitSystem("/nowhere/at/all", std::nullopt).notify("READY=1");
  InitSystem(std::string(200, 'x'), std::nullopt).notify("READY=1");
  SUCCEED();
}

TEST(InitSystem, IsKnownFromTheEnvironment) {
  const test::ScratchDirectory directory;
  const std::string path = (directory / "notify").string();
  const test::NoticeReceiver receiver(path);
  setenv("NOTIFY_SOCKET", path.c_str(), 1);
  setenv("WATCHDOG_USEC", "30000000", 1);
  const InitSystem init_system = InitSystem::from_environment();
  init_system.notify("STATUS=well");
  EXPECT_EQ(receiver.receive(), "STATUS=well");
  EXPECT_EQ(init_system.watchdog_interval(), 15s) << "half of the time";

  for (const char* const value : {"0", "-5", "soon", "5 "}) {
    setenv("WATCHDOG_USEC", value, 1);
    EXPECT_EQ(InitSystem::from_environment().watchdog_interval(), std::nullopt) << value;
  }
  unsetenv("NOTIFY_SOCKET");
  unsetenv("WATCHDOG_USEC");
  EXPECT_EQ(InitSystem::from_environment().watchdog_interval(), std::nullopt);
}

TEST(ServiceNotices, SayEachStateOnce) {
  const test::ScratchDirectory directory;
  const std::string path = (directory / "notify").string();
  const test::NoticeReceiver receiver(path);
  ServiceNotices notices(InitSystem(path, std::nullopt));
  notices.ready();
  notices.ready();
  notices.stopping();
  notices.stopping();
  InitSystem(path, std::nullopt).notify("END");
  EXPECT_EQ(receiver.receive(), "READY=1");
  EXPECT_EQ(receiver.receive(), "STOPPING=1");
  EXPECT_EQ(receiver.receive(), "END");
}

// Of a watchdog that waits 4 s: every 2 s that the service lives, every 5 s what it does.
TEST(ServiceNotices, ComeInTime) {
  const test::ScratchDirectory directory;
  const std::string path = (directory / "notify").string();
  const test::NoticeReceiver receiver(path);
  ServiceNotices notices(InitSystem(path, 4s));
  const ServiceNotices::TimePoint start{};
  for (int second = 0; second <= 6; ++second) {
    notices.on_tick(start + std::chrono::seconds(second), [&] { return std::to_string(second); });
  }
  for (const char* const expected :
       {"WATCHDOG=1", "STATUS=0", "WATCHDOG=1", "WATCHDOG=1", "STATUS=5", "WATCHDOG=1"}) {
    EXPECT_EQ(receiver.receive(), expected);
  }
}

}  // namespace
}  // namespace proofmass::wire
