#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <thread>

#include "coordinator/archive/verification.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/exit_code.hpp"
#include "coordinator/cli/standard_output.hpp"
#include "coordinator/cli/stop_signals.hpp"
#include "proto/command_line/option_checks.hpp"
#include "proto/command_line/standard_error.hpp"

namespace proofmass::coordinator {
namespace {

struct VerifyCommandOptions {
  std::filesystem::path database;
  double fraction = 0.01;  ///< Of the runs, simulated again; in [0, 1].
};

int verify_database(const VerifyCommandOptions& options) {
  return run_until_stopped([&](const IsStopped& is_stopped) {
    const VerifyOptions how{.fraction = options.fraction,
                            .num_threads = std::max(1U, std::thread::hardware_concurrency())};
    std::size_t num_failing = 0, num_checks = 0;
    const auto report = [&](const Check& check) {
      ++num_checks;
      if (check.verdict == Verdict::fails) ++num_failing;
      print_lines(check_text(check));
      flush_standard_output();  // The simulation may take long.
    };
    if (verify(options.database, how, report, is_stopped)) return exit_done;
    wire::say(fmt::format("proofmass: error: {}: {} of {} checks {}\n", options.database.string(),
                          num_failing, num_checks, num_failing == 1 ? "fails" : "fail"));
    return exit_cannot_be_done;
  });
}

}  // namespace

void add_verify(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<VerifyCommandOptions>(
      app, chosen, "verify", "Check a database, simulate some runs again", verify_database);
  command.footer(exit_codes_text({exit_interrupted}));
  command.add_option("DB", options.database, database_text)->required();
  command.add_option("--fraction", options.fraction, "Of the runs to simulate again")
      ->check(wire::in_range(0.0, 1.0))
      ->capture_default_str();
}

}  // namespace proofmass::coordinator
