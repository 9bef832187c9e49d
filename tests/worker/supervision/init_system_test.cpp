#include "worker/supervision/init_system.hpp"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cstddef>
#include <cstdlib>

#include "tests/worker/temporary_directory.hpp"

namespace proofmass::worker {
namespace {

using namespace std::chrono_literals;

/// A init system's end of the socket.
class Receiver {
 public:
  /// @param name  Path, or `@NAME`.
  explicit Receiver(const std::string& name) : file_(socket(AF_UNIX, SOCK_DGRAM, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    name.copy(address.sun_path, name.size());
    if (name.front() == '@') address.sun_path[0] = '\0';
    const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + name.size());
    EXPECT_EQ(bind(file_, reinterpret_cast<const sockaddr*>(&address), size), 0);
  }
  ~Receiver() { close(file_); }
  Receiver(const Receiver&) = delete;
  Receiver& operator=(const Receiver&) = delete;

  /// What has come, or nothing.
  [[nodiscard]] std::string receive() const {
    std::array<char, 256> buffer{};
    const ssize_t size = recv(file_, buffer.data(), buffer.size(), MSG_DONTWAIT);
    return size < 0 ? "" : std::string(buffer.data(), static_cast<std::size_t>(size));
  }

 private:
  int file_;
};

TEST(InitSystem, IsToldThroughItsSocket) {
  const TemporaryDirectory directory;
  const std::string path = (directory / "notify").string();
  const Receiver receiver(path);
  const InitSystem init_system(path, std::nullopt);
  init_system.notify("READY=1");
  EXPECT_EQ(receiver.receive(), "READY=1");
}

TEST(InitSystem, MayHaveAnAbstractSocket) {
  const std::string name = "@proofmass-test-" + std::to_string(getpid());
  const Receiver receiver(name);
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
  const TemporaryDirectory directory;
  const std::string path = (directory / "notify").string();
  const Receiver receiver(path);
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

}  // namespace
}  // namespace proofmass::worker
