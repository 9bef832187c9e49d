#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <string>
#include <vector>

#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/program.hpp"
#include "coordinator/factory/factory.hpp"
#include "core/error.hpp"
#include "tests/message_of.hpp"

namespace proofmass::coordinator {
namespace {

using testing::AllOf;
using testing::HasSubstr;

/// Runs `proofmass factory` for Slurm with further arguments; what it prints.
std::string output_of_factory(std::vector<std::string> further) {
  std::vector<std::string> arguments{"factory",     "--batch-system",    "slurm",
                                     "--connect",   "tcp://127.0.0.1:1", "--worker-connect",
                                     "tcp://head:2"};
  arguments.insert(arguments.end(), further.begin(), further.end());
  std::ranges::reverse(arguments);  // As CLI11 takes them.
  CLI::App app("", "proofmass");
  Command chosen;
  add_factory(app, chosen);
  app.parse(arguments);
  testing::internal::CaptureStdout();
  try {
    (void)chosen();
  } catch (...) {
    (void)testing::internal::GetCapturedStdout();
    throw;
  }
  return testing::internal::GetCapturedStdout();
}

std::string refusal_of_factory(const std::vector<std::string>& further) {
  return test::message_of<Error>([&] { (void)output_of_factory(further); });
}

TEST(FactoryCommand, ShowsHowAWorkerWouldBeQueued) {
  EXPECT_THAT(output_of_factory({"--dry-run", "--name", "fleet", "--walltime", "90", "--processors",
                                 "4", "--worker-keys", "/home/a b/keys", "--worker-start-cmd",
                                 "module load x", "--worker-wrap-cmd", "apptainer exec y.sif",
                                 "--idle-timeout", "60", "--submit-option=--partition=long"}),
              AllOf(HasSubstr("'--time=1:30:00' '--cpus-per-task=4' '--partition=long'\n"),
                    HasSubstr("\nmodule load x && exec apptainer exec y.sif proofmass-worker "
                              "--connect 'tcp://head:2' --name fleet-\"$1\" --max-walltime 5340s "
                              "--idle-timeout 60s --keys '/home/a b/keys' --threads 4\n")));
}

TEST(FactoryCommand, RefusesWhatCannotBe) {
  EXPECT_EQ(refusal_of_factory({"--dry-run", "--workers-min", "5", "--workers-max", "3"}),
            "--workers-min = 5 (must be at most --workers-max, 3)");
  EXPECT_EQ(refusal_of_factory({"--dry-run", "--name", "a b"}),
            "--name = \"a b\" (must be 1 to 60 of [A-Za-z0-9._-], a letter or digit first)");
  EXPECT_EQ(refusal_of_factory({"--dry-run", "--name", std::string(61, 'a')}),
            "--name = \"" + std::string(61, 'a') +
                "\" (must be 1 to 60 of [A-Za-z0-9._-], a letter or digit first)");
  EXPECT_EQ(refusal_of_factory({"--dry-run", "--worker-start-cmd", "a\nb"}),
            "--worker-start-cmd (must be one line)");
}

}  // namespace
}  // namespace proofmass::coordinator
