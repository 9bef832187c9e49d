#include "proto/link/start_program.hpp"

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <csignal>
#include <string>

#include "proto/link/surroundings.hpp"

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

}  // namespace
}  // namespace proofmass::wire
