#include "proto/link/machine.hpp"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>

#include "tests/proto/link/scratch_directory.hpp"

namespace proofmass::wire {
namespace {

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
