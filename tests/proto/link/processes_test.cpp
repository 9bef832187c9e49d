#include <signal.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>

#include "proto/link/machine.hpp"
#include "tests/proto/link/scratch_directory.hpp"
#include "tests/test.hpp"

namespace proofmass::wire {
namespace {

/// How lines of `sh` ended, as waitpid() tells it.
int status_of_shell(const std::string& lines) {
  int status = 0;
  waitpid(start_program({.arguments = {"/bin/sh", "-c", lines}}), &status, 0);
  return status;
}

// A filter that is started should end with its reader, as all programs expect.
TEST(StartProgram, LetsABrokenPipeEndTheProgramThatItDoesNotEndHere) {
  ignore_broken_pipes();
  (void)std::raise(SIGPIPE);
  const int status = status_of_shell("kill -PIPE $$");
  EXPECT_TRUE(WIFSIGNALED(status));
  EXPECT_EQ(WTERMSIG(status), SIGPIPE);
  (void)std::signal(SIGPIPE, SIG_DFL);
}

/// An init system's end of the socket.
class NoticeReceiver {
 public:
  /// @param name  Path, or `@NAME`.
  explicit NoticeReceiver(const std::string& name) : file_(socket(AF_UNIX, SOCK_DGRAM, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    name.copy(address.sun_path, name.size());
    if (name.front() == '@') address.sun_path[0] = '\0';
    const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + name.size());
    EXPECT_EQ(bind(file_, reinterpret_cast<const sockaddr*>(&address), size), 0);
  }
  ~NoticeReceiver() { close(file_); }
  NoticeReceiver(const NoticeReceiver&) = delete;
  NoticeReceiver& operator=(const NoticeReceiver&) = delete;

  /// What has come, or nothing.
  [[nodiscard]] std::string receive() const {
    std::array<char, 256> buffer{};
    const ssize_t size = recv(file_, buffer.data(), buffer.size(), MSG_DONTWAIT);
    return size < 0 ? "" : std::string(buffer.data(), static_cast<std::size_t>(size));
  }

 private:
  int file_;
};

TEST(ServiceNotices, MayGoToAnAbstractSocket) {
  const std::string name = "@proofmass-test-" + std::to_string(getpid());
  const NoticeReceiver receiver(name);
  ServiceNotices(name, std::nullopt).stopping();
  EXPECT_EQ(receiver.receive(), "STOPPING=1");
}

TEST(ServiceNotices, NeedNoInitSystem) {
  ServiceNotices("", std::nullopt).ready();
  ServiceNotices("/nowhere/at/all", std::nullopt).ready();
  ServiceNotices(std::string(200, 'x'), std::nullopt).ready();
  SUCCEED();
}

TEST(ServiceNotices, FindTheInitSystemInTheEnvironment) {
  const test::ScratchDirectory directory;
  const std::string path = (directory / "notify").string();
  const NoticeReceiver receiver(path);
  const auto tick = [] { ServiceNotices().on_tick({}, [] { return "well"; }); };
  setenv("NOTIFY_SOCKET", path.c_str(), 1);
  setenv("WATCHDOG_USEC", "30000000", 1);
  tick();
  EXPECT_EQ(receiver.receive(), "WATCHDOG=1");
  EXPECT_EQ(receiver.receive(), "STATUS=well");

  for (const char* const value : {"0", "-5", "soon", "5 "}) {
    setenv("WATCHDOG_USEC", value, 1);
    tick();
    EXPECT_EQ(receiver.receive(), "STATUS=well") << value;
  }
  unsetenv("WATCHDOG_USEC");
  tick();
  EXPECT_EQ(receiver.receive(), "STATUS=well");
  unsetenv("NOTIFY_SOCKET");
}

// Of a watchdog that waits 4 s: every 2 s that the service lives, every 5 s what it does.
TEST(ServiceNotices, ComeInTime) {
  const test::ScratchDirectory directory;
  const std::string path = (directory / "notify").string();
  const NoticeReceiver receiver(path);
  ServiceNotices notices(path, 4s);
  const ServiceNotices::TimePoint start{};
  for (int second = 0; second <= 6; ++second) {
    notices.on_tick(start + std::chrono::seconds(second), [&] { return std::to_string(second); });
  }
  for (const char* const expected :
       {"WATCHDOG=1", "STATUS=0", "WATCHDOG=1", "WATCHDOG=1", "STATUS=5", "WATCHDOG=1"}) {
    EXPECT_EQ(receiver.receive(), expected);
  }
}

/// How a process ended, as waitpid() tells it, which ended itself so; exited with 1 by signal 0.
int status_after(int signal) {
  const pid_t child = fork();
  if (child == 0) {
    if (signal != 0) raise(signal);
    _exit(1);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return status;
}

TEST(OomKills, AreReadFromTheKernelsCounters) {
  EXPECT_EQ(oom_kills_in("nr_free_pages 1\noom_kill 17\nnuma_hit 2\n"), 17U);
  EXPECT_EQ(oom_kills_in("nr_free_pages 1\n"), 0U);
}

// A container sees the path of the host.
TEST(ProcessorQuota, IsTheSmallestOfAllControlGroupsAbove) {
  const test::ScratchDirectory root;
  const auto write = [&](const std::string& file, const std::string& text) {
    std::filesystem::create_directories((root / file).parent_path());
    std::ofstream(root / file) << text;
  };
  write("a/cpu.max", "150000 100000\n");
  write("a/b/cpu.max", "max 100000\n");
  EXPECT_EQ(processor_quota("0::/a/b\n", root.path()), 1.5);
  EXPECT_EQ(processor_quota("0::/\n", root.path()), std::numeric_limits<double>::infinity());
  write("cpu.max", "50000 100000\n");
  EXPECT_EQ(processor_quota("5:memory:/a\n0::/of/the/host\n", root.path()), 0.5);
  EXPECT_GE(num_processors(), 1U);
}

pid_t child_that_exits(int exit_code) {
  const pid_t child = fork();
  if (child == 0) _exit(exit_code);
  return child;
}

TEST(EndOfAChild, IsWhatTheKernelSaysOfIt) {
  EXPECT_EQ(end_text(wait_for_end(child_that_exits(0))), "exit code 0");
  EXPECT_EQ(end_text(wait_for_end(child_that_exits(7))), "exit code 7");
  const pid_t child = fork();
  while (child == 0) pause();
  EXPECT_FALSE(status_if_ended(child));
  kill(child, SIGKILL);
  EXPECT_EQ(end_text(wait_for_end(child)), "killed by signal 9 (Killed)");
}

TEST(EndOfAChild, IsAFailureIfTheKernelDoesNotKeepIt) {
  (void)std::signal(SIGCHLD, SIG_IGN);
  const pid_t child = child_that_exits(0);
  EXPECT_EQ(end_text(wait_for_end(child)), "exit code 1");
  const auto status = status_if_ended(child);
  (void)std::signal(SIGCHLD, SIG_DFL);
  ASSERT_TRUE(status);
  EXPECT_EQ(end_text(*status), "exit code 1");
}

TEST(ReasonOfEnd, BlamesRunsForACrashAndForWantOfMemory) {
  EXPECT_EQ(reason_of_end(status_after(SIGILL), false), LossReason::crashed);
  EXPECT_EQ(reason_of_end(status_after(SIGILL), true), LossReason::crashed);
  EXPECT_EQ(reason_of_end(status_after(SIGKILL), true), LossReason::out_of_memory);
}

TEST(ReasonOfEnd, BlamesNoRunIfSomebodyKilledTheProcess) {
  EXPECT_EQ(reason_of_end(status_after(SIGKILL), false), LossReason::preempted);
  EXPECT_EQ(reason_of_end(status_after(0), true), LossReason::failed);
}

}  // namespace
}  // namespace proofmass::wire
