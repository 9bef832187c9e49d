#include "proto/link/machine.hpp"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>

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
