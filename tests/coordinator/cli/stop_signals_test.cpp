#include <poll.h>
#include <signal.h>
#include <stdlib.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>

#include "coordinator/cli/local_run.hpp"
#include "coordinator/cli/program.hpp"
#include "tests/proto/link/scratch_directory.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

// How the programs take the signals that the kernel sends them.

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

constexpr int timeout_ms = 100;

std::atomic<int> num_handled = 0;
std::atomic<bool> is_handled_here = false;
thread_local bool is_this_thread = false;

class SignalThreadTest : public testing::Test {
 protected:
  void SetUp() override {
    num_handled = 0;
    is_handled_here = false;
    is_this_thread = true;
    for (const int number : {SIGINT, SIGTERM}) {
      (void)std::signal(number, [](int) {
        ++num_handled;
        if (is_this_thread) is_handled_here = true;
      });
    }
  }
  void TearDown() override {
    for (const int number : {SIGINT, SIGTERM}) (void)std::signal(number, SIG_DFL);
  }

  /// Waits until the time is over while signals come: 0, or the error that ended it.
  static int error_of_waiting() {
    std::atomic<bool> is_over = false;
    std::thread sender([&] {
      while (!is_over) {
        const int num_before = num_handled;
        kill(getpid(), num_before % 2 == 0 ? SIGTERM : SIGINT);
        while (num_handled == num_before && !is_over) std::this_thread::yield();
      }
    });
    const int error = poll(nullptr, 0, timeout_ms) == 0 ? 0 : errno;
    is_over = true;
    sender.join();
    return error;
  }
};

TEST_F(SignalThreadTest, LetsNoSignalInterruptACall) {
  const SignalThread signals;
  EXPECT_EQ(error_of_waiting(), 0);
  EXPECT_GT(num_handled, 1);
  EXPECT_FALSE(is_handled_here);
}

TEST_F(SignalThreadTest, LeavesSignalsAsTheyWere) {
  { const SignalThread signals; }
  raise(SIGTERM);
  EXPECT_TRUE(is_handled_here);
}

/// Ends this process with the request that a signal leads to, where SIGHUP was handled so before.
[[noreturn]] void exit_with_request_after(int signal, void (*former_handler)(int)) {
  (void)std::signal(SIGHUP, former_handler);
  const std::atomic<StopRequest>& request = catch_stop_signals(OnTerminate::drain);
  (void)raise(signal);
  _exit(static_cast<int>(request.load()));
}

/// A program in the place of the worker's, or of a model's.
std::filesystem::path script(const test::ScratchDirectory& directory, const std::string& text) {
  const auto file = directory / "worker";
  std::ofstream(file) << "#!/bin/sh\n" << text << '\n';
  std::filesystem::permissions(file, std::filesystem::perms::owner_all);
  return file;
}

// The model has not yet said what it is, and hangs.
TEST(StopSignalsDeathTest, EndAProgramInOrderFromItsStart) {
  const test::ScratchDirectory directory;
  for (const std::string signal : {"INT", "TERM"}) {
    const std::string model =
        script(directory, "read question; kill -" + signal + " $PPID; sleep 1000");
    for (const std::string command : {"run", "verify"}) {
      EXPECT_EXIT(
          _exit(run_with(run_proofmass, {"proofmass", command, "--model-program", model, "a.db"})),
          testing::ExitedWithCode(exit_interrupted), "^proofmass: interrupted\n$");
    }
  }
}

/// Ends this process with 0 if a program that is started with a signal ignored leaves it ignored,
/// or if the signal kills as usual.
[[noreturn]] void exit_with_handler_left(void (*handler)(int)) {
  (void)std::signal(SIGINT, handler);
  end_at_stop_signals();
  let_stop_signals_kill();
  _exit(std::signal(SIGINT, SIG_DFL) == handler ? 0 : 1);
}

TEST(StopSignalsDeathTest, AreWhatTheyWereOnceACommandBegins) {
  EXPECT_EXIT(exit_with_handler_left(SIG_DFL), testing::ExitedWithCode(0), "");
  EXPECT_EXIT(exit_with_handler_left(SIG_IGN), testing::ExitedWithCode(0), "");
}

testing::ExitedWithCode ends_with(StopRequest request) {
  return testing::ExitedWithCode(static_cast<int>(request));
}

TEST(StopSignalsDeathTest, LeaveTheWorkersOnAHangUp) {
  EXPECT_EXIT(exit_with_request_after(SIGHUP, SIG_DFL), ends_with(StopRequest::leave), "");
  EXPECT_EXIT(exit_with_request_after(SIGTERM, SIG_DFL), ends_with(StopRequest::drain), "");
}

// As `nohup` does.
TEST(StopSignalsDeathTest, LeaveAHangUpIgnoredThatWasIgnoredBefore) {
  EXPECT_EXIT(exit_with_request_after(SIGHUP, SIG_IGN), ends_with(StopRequest::none), "");
}

WorkerProcesses::Exit exit_of(const std::string& text) {
  const test::ScratchDirectory directory;
  WorkerProcesses processes(script(directory, text), "ipc:///nowhere");
  processes.start("local-1");
  while (true) {
    const auto exits = processes.take_exits();
    if (!exits.empty()) return exits.front();
  }
}

TEST(WorkerProcesses, GiveAWorkerItsNameItsCoordinatorAndItsParent) {
  const auto exit = exit_of(
      "[ \"$1 $2 $3 $4 $5 $6 $7 $8 $9\" = \"--connect ipc:///nowhere --name local-1 --threads 1 "
      "--gpu none --parent\" ]");
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

}  // namespace
}  // namespace proofmass::coordinator
