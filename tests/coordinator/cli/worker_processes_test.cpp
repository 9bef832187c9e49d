#include "coordinator/cli/worker_processes.hpp"

#include <gtest/gtest.h>
#include <stdlib.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>

#include "coordinator/cli/stop_signals.hpp"
#include "core/error.hpp"
#include "tests/coordinator/cli/temporary_directory.hpp"

namespace proofmass::coordinator {
namespace {

/// A program in the place of the worker's.
std::filesystem::path script(const test::TemporaryDirectory& directory, const std::string& text) {
  const auto file = directory / "worker";
  std::ofstream(file) << "#!/bin/sh\n" << text << '\n';
  std::filesystem::permissions(file, std::filesystem::perms::owner_all);
  return file;
}

WorkerProcesses::Exit exit_of(const std::string& text) {
  const test::TemporaryDirectory directory;
  WorkerProcesses processes(script(directory, text), "ipc:///nowhere");
  processes.start("local-1");
  while (true) {
    const auto exits = processes.take_exits();
    if (!exits.empty()) return exits.front();
  }
}

TEST(WorkerProcesses, SayHowAWorkerEnded) {
  const auto failed = exit_of("exit 3");
  EXPECT_EQ(failed.name, "local-1");
  EXPECT_EQ(failed.text, "exit code 3");
  EXPECT_EQ(failed.reason, wire::LossReason::failed);
  const auto crashed = exit_of("kill -SEGV $$");
  EXPECT_EQ(crashed.text, "killed by signal 11 (Segmentation fault)");
  EXPECT_EQ(crashed.reason, wire::LossReason::crashed);
  EXPECT_EQ(exit_of("kill -KILL $$").reason, wire::LossReason::preempted);
}

TEST(WorkerProcesses, GiveAWorkerItsNameItsCoordinatorAndItsParent) {
  const auto exit = exit_of(
      "[ \"$1 $2 $3 $4 $5 $6 $7\" = \"--connect ipc:///nowhere --name local-1 --threads 1 "
      "--parent\" ]");
  EXPECT_EQ(exit.text, "exit code 0");
}

// A user may have set it for workers of a cluster, with whose coordinator this has nothing to do.
TEST(WorkerProcesses, KeepSettingsOfOtherWorkersFromAWorker) {
  const std::map<std::string, std::string> settings{{"PROOFMASS_GIVE_UP_AFTER", "1s"},
                                                    {"PROOFMASS_DRAIN_TIME", "xx"},
                                                    {"SLURM_JOB_END_TIME", "1"}};
  for (const auto& [name, value] : settings) setenv(name.c_str(), value.c_str(), 1);
  EXPECT_EQ(exit_of("! env | grep -E '^(PROOFMASS_|SLURM_JOB_END_TIME=)'").text, "exit code 0");
  EXPECT_EQ(exit_of("env | grep -q ^PATH=").text, "exit code 0");
  for (const auto& [name, value] : settings) unsetenv(name.c_str());
}

TEST(WorkerProcesses, AWorkerIsEndedBySignalsThatAreBlockedHere) {
  const SignalThread signals;
  EXPECT_EQ(exit_of("kill -TERM $$").text, "killed by signal 15 (Terminated)");
}

TEST(WorkerProcesses, SayThatAProgramCannotBeStarted) {
  WorkerProcesses processes("/nowhere/worker", "ipc:///nowhere");
  try {
    processes.start("local-1");
    FAIL();
  } catch (const Error& error) {
    EXPECT_STREQ(error.what(), "/nowhere/worker: cannot be started: No such file or directory");
  }
}

}  // namespace
}  // namespace proofmass::coordinator
