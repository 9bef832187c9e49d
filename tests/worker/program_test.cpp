#include "worker/program.hpp"

#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <csignal>

#include "core/error.hpp"
#include "proto/command_line/option_checks.hpp"
#include "tests/proto/link/scratch_directory.hpp"
#include "tests/test.hpp"

namespace proofmass::worker {
namespace {

Options parsed(std::vector<std::string> arguments) {
  Options options;
  CLI::App app("worker");
  add_options(app, options);
  std::reverse(arguments.begin(), arguments.end());  // As CLI11 wants them.
  try {
    app.parse(arguments);
  } catch (const CLI::ParseError& error) {
    throw InvalidArgument(wire::refusal_of(app, error));
  }
  return options;
}

std::string error_of(const std::vector<std::string>& arguments) {
  try {
    (void)parsed(arguments);
  } catch (const InvalidArgument& error) {
    return error.what();
  }
  return "none";
}

TEST(WorkerOptions, HaveDefaults) {
  const Options options = parsed({"--connect", "ipc:///tmp/a"});
  EXPECT_EQ(options.serving.endpoint, "ipc:///tmp/a");
  EXPECT_EQ(options.serving.conversation.drain_time, 100s);
  EXPECT_FALSE(options.walltime_max.has_value());
  EXPECT_FALSE(options.give_up_after.has_value());
  EXPECT_FALSE(options.keys.has_value());
  EXPECT_GE(num_threads_of(options, 1), 1U);
  EXPECT_EQ(options.log_format, wire::LogFormat::text);
  EXPECT_TRUE(options.is_supervised);
}

TEST(WorkerOptions, ComeFromArguments) {
  const Options options =
      parsed({"--connect",      "tcp://a:1", "--keys",          "k",
              "--name",         "n",         "--threads",       "3",
              "--max-walltime", "90m",       "--spool",         "s",
              "--drain-time",   "30",        "--give-up-after", "2h",
              "--log-format",   "json",      "--no-supervisor", "--insecure-plain",
              "--parent",       "12"});
  EXPECT_EQ(options.keys, "k");
  EXPECT_EQ(options.name, "n");
  EXPECT_EQ(options.num_threads, 3U);
  EXPECT_EQ(options.walltime_max, 90min);
  EXPECT_EQ(options.serving.spool, "s");
  EXPECT_EQ(options.serving.conversation.drain_time, 30s);
  EXPECT_EQ(options.give_up_after, 2h);
  EXPECT_EQ(options.log_format, wire::LogFormat::json);
  EXPECT_FALSE(options.is_supervised);
  EXPECT_TRUE(options.is_plain_waived);
  EXPECT_EQ(options.parent, 12);
}

TEST(WorkerOptions, ComeFromTheEnvironment) {
  setenv("PROOFMASS_CONNECT", "ipc:///tmp/b", 1);
  setenv("PROOFMASS_MAX_WALLTIME", "1d", 1);
  setenv("PROOFMASS_SPOOL", "/s", 1);
  setenv("SLURM_JOB_END_TIME", "1800000000", 1);
  const Options options = parsed({});
  unsetenv("PROOFMASS_CONNECT");
  unsetenv("PROOFMASS_MAX_WALLTIME");
  unsetenv("PROOFMASS_SPOOL");
  unsetenv("SLURM_JOB_END_TIME");
  EXPECT_EQ(options.serving.endpoint, "ipc:///tmp/b");
  EXPECT_EQ(options.walltime_max, 24h);
  EXPECT_EQ(options.serving.spool, "/s");
  EXPECT_EQ(options.end_time_unix_s, 1'800'000'000);
}

TEST(WorkerOptions, MustBeOfTheKnownKinds) {
  const auto error_with = [&](const std::string& name, const std::string& value) {
    return error_of({"--connect", "ipc:///tmp/a", name, value});
  };
  EXPECT_EQ(error_with("--threads", "0"), "--threads = 0 (must be in [1, 256])");
  EXPECT_EQ(error_with("--end-time", "noon"),
            "--end-time = noon (must be a whole number in [0, 9999999999])");
  EXPECT_EQ(error_with("--log-format", "xml"), "--log-format = xml (must be one of json, text)");
  EXPECT_EQ(error_with("--faults", "drop=2").substr(0, 15), "faults.drop = 2");  // Of tests alone.
  EXPECT_EQ(
      error_with("--max-walltime", "5x"),
      "--max-walltime = 5x (must be 1 or more, in seconds or with s, m, h or d; at most 366d)");
}

TEST(WorkerOptions, FromVariablesAreRefusedByTheirNames) {
  const auto error_with = [](const char* variable, const char* value) {
    setenv(variable, value, 1);
    const std::string error = error_of({"--connect", "ipc:///tmp/a", "--idle-timeout", "1s"});
    unsetenv(variable);
    return error;
  };
  EXPECT_EQ(error_with("PROOFMASS_THREADS", "0"), "PROOFMASS_THREADS = 0 (must be in [1, 256])");
  EXPECT_EQ(error_with("SLURM_JOB_END_TIME", "abc"),
            "SLURM_JOB_END_TIME = abc (must be a whole number in [0, 9999999999])");
  EXPECT_EQ(error_with("PROOFMASS_LOG_FORMAT", "xml"),
            "PROOFMASS_LOG_FORMAT = xml (must be one of json, text)");
  EXPECT_EQ(error_with("PROOFMASS_MAX_WALLTIME", "5y"),
            "PROOFMASS_MAX_WALLTIME = 5y (must be 1 or more, in seconds or with s, m, h or d; at "
            "most 366d)");
  EXPECT_EQ(error_with("PROOFMASS_IDLE_TIMEOUT", "5y"), "none") << "an argument is there";
}

TEST(WorkerOptions, AreGivenOnce) {
  EXPECT_EQ(error_of({"--connect", "ipc:///tmp/a", "--idle-timeout", "1s", "--idle-timeout", "2s"}),
            "option = --idle-timeout (must be given once)");
}

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
  const Program program{.name = "test-worker"};
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
