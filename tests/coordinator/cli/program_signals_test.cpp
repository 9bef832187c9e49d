// How the programs take the signals that the kernel sends them.

#include <gtest/gtest.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <csignal>
#include <string>
#include <vector>

#include "coordinator/cli/program.hpp"

namespace proofmass::coordinator {
namespace {

using ProgramMain = int (*)(int argc, char** argv);

int run_with(ProgramMain program, std::vector<std::string> arguments) {
  std::vector<char*> argv;
  for (std::string& argument : arguments) argv.push_back(argument.data());
  return program(static_cast<int>(argv.size()), argv.data());
}

/// Ends this process as a program does whose messages go into a pipe that nobody reads.
[[noreturn]] void exit_without_reader(ProgramMain program,
                                      const std::vector<std::string>& arguments) {
  int ends[2];
  if (pipe(ends) != 0) _exit(99);
  close(ends[0]);
  dup2(ends[1], STDERR_FILENO);
  (void)std::signal(SIGPIPE, SIG_DFL);
  _exit(run_with(program, arguments));
}

/// Ends this process with 0 if a program that is started with SIGCHLD ignored does not ignore it.
[[noreturn]] void exit_with_children_ignored(ProgramMain program, const std::string& name) {
  (void)std::signal(SIGCHLD, SIG_IGN);
  (void)run_with(program, {name, "--version"});
  _exit(std::signal(SIGCHLD, SIG_DFL) == SIG_DFL ? 0 : 1);
}

// Otherwise it would never learn how the programs ended that it starts.
TEST(ProgramSignalsDeathTest, AProgramDoesNotIgnoreItsChildrenWhoeverStartsIt) {
  EXPECT_EXIT(exit_with_children_ignored(run_proofmass, "proofmass"), testing::ExitedWithCode(0),
              "");
  EXPECT_EXIT(exit_with_children_ignored(run_proofmass_coordinator, "proofmass-coordinator"),
              testing::ExitedWithCode(0), "");
}

// Each of them says what is wrong, and would go on likewise if it were only progress.
TEST(ProgramSignalsDeathTest, ABrokenPipeDoesNotEndWhatComputesACampaign) {
  EXPECT_EXIT(exit_without_reader(run_proofmass_coordinator,
                                  {"proofmass-coordinator", "--bind", "ipc:///tmp/none",
                                   "--directory", "/dev/null/served"}),
              testing::ExitedWithCode(exit_cannot_be_done), "");
  EXPECT_EXIT(exit_without_reader(run_proofmass, {"proofmass", "run", "/dev/null/a.toml"}),
              testing::ExitedWithCode(exit_wrong_usage), "");
  EXPECT_EXIT(exit_without_reader(run_proofmass, {"proofmass", "sweep", "/dev/null/a.toml",
                                                  "--vary", "simulation.orbits=1,2"}),
              testing::ExitedWithCode(exit_wrong_usage), "");
  EXPECT_EXIT(
      exit_without_reader(run_proofmass, {"proofmass", "factory", "--batch-system", "slurm",
                                          "--connect", "tcp://127.0.0.1:1", "--worker-connect",
                                          "tcp://head:2", "--name", "no name"}),
      testing::ExitedWithCode(exit_wrong_usage), "");
}

}  // namespace
}  // namespace proofmass::coordinator
