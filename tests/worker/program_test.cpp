#include "worker/program.hpp"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <string>
#include <utility>
#include <vector>

namespace proofmass::worker {
namespace {

struct Outcome {
  int exit_code = -1;
  std::string text;  ///< On standard error.
};

/// Ends this process as a worker does that writes to such a standard error.
[[noreturn]] void be_worker(std::vector<std::string> arguments, int standard_error) {
  dup2(standard_error, STDERR_FILENO);
  arguments.insert(arguments.begin(), "test-worker");
  std::vector<char*> argv;
  for (std::string& argument : arguments) argv.push_back(argument.data());
  const Program program{.name = "test-worker",
                        .prepare = [](const Campaign&) { return PreparedCampaign{}; }};
  _exit(run_worker(static_cast<int>(argv.size()), argv.data(), program));
}

int exit_code_of(pid_t process) {
  int status = 0;
  waitpid(process, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

/// Runs a worker in a process of its own.
Outcome run(std::vector<std::string> arguments) {
  int ends[2];
  if (pipe(ends) != 0) return {};
  const pid_t process = fork();
  if (process == 0) be_worker(std::move(arguments), ends[1]);
  close(ends[1]);
  Outcome outcome;
  std::array<char, 4096> part{};
  ssize_t size = 0;
  while ((size = read(ends[0], part.data(), part.size())) > 0) {
    outcome.text.append(part.data(), static_cast<std::size_t>(size));
  }
  close(ends[0]);
  outcome.exit_code = exit_code_of(process);
  return outcome;
}

TEST(WorkerProgram, NeedsItsKeys) {
  const Outcome outcome = run({"--connect", "tcp://10.0.0.1:5555", "--keys", "/nowhere"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_NE(outcome.text.find("key directory = /nowhere (No such file"), std::string::npos)
      << outcome.text;
}

// Found by the second process, whose exit code is handed on.
TEST(WorkerProgram, NeedsAName) {
  for (const char* const supervision : {"--no-supervisor", "--log-format=text"}) {
    const Outcome outcome = run({"--connect", "ipc:///tmp/none", "--name", "a b", supervision});
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_EQ(outcome.text,
              "test-worker: error: name = a b (must be 1 to 128 of [A-Za-z0-9._-], a letter or "
              "digit first)\n");
  }
}

// Its first process has to learn that the second one has ended.
TEST(WorkerProgram, EndsIfItWasStartedWithItsChildrenIgnored) {
  const pid_t process = fork();
  if (process == 0) {
    (void)std::signal(SIGCHLD, SIG_IGN);
    alarm(60);  // Without it, a worker that never ends would hold the test up.
    be_worker({"--connect", "ipc:///tmp/none", "--name", "a b"}, STDERR_FILENO);
  }
  EXPECT_EQ(exit_code_of(process), 2);
}

// As at the end of a pipe to `head`.
TEST(WorkerProgram, GoesOnIfNobodyReadsItsLog) {
  int ends[2];
  ASSERT_EQ(pipe(ends), 0);
  close(ends[0]);
  const pid_t process = fork();
  if (process == 0) {
    (void)std::signal(SIGPIPE, SIG_DFL);
    be_worker({"--connect", "ipc:///tmp/none", "--name", "a b"}, ends[1]);
  }
  close(ends[1]);
  EXPECT_EQ(exit_code_of(process), 2) << "it could say why, but for the reader";
}

TEST(WorkerProgram, DoesNotOutliveItsCampaign) {
  const Outcome outcome = run({"--connect", "ipc:///tmp/none", "--parent", "1"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_EQ(outcome.text, "test-worker: error: the program that started this worker has ended\n");
}

}  // namespace
}  // namespace proofmass::worker
