#include "coordinator/cli/commands/verify.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <nlohmann/json.hpp>

#include "coordinator/cli/output.hpp"
#include "coordinator/cli/stop_signals.hpp"
#include "proto/command_line/option_checks.hpp"
#include "proto/command_line/standard_error.hpp"
#include "proto/link/machine.hpp"

namespace proofmass::coordinator {
namespace {

struct VerifyCommandOptions {
  std::filesystem::path database;
  double fraction = 0.01;  ///< Of the runs, simulated again; in [0, 1].
  OutputFormat format = OutputFormat::text;
};

using Json = nlohmann::ordered_json;

Json json_of_check(const Check& check) {
  return {{"name", check.name},
          {"verdict", word_for(check.verdict)},
          {"finding", check.finding},
          {"details", check.details}};
}

int verify_database(const VerifyCommandOptions& options) {
  return run_until_stopped([&](const IsStopped& is_stopped) {
    const VerifyOptions how{.fraction = options.fraction, .num_threads = wire::num_processors()};
    return print_checks(options.database, options.format, [&](const auto& report) {
      return verify(options.database, how, report, is_stopped);
    });
  });
}

}  // namespace

int print_checks(const std::filesystem::path& file, OutputFormat format,
                 const std::function<bool(const std::function<void(const Check&)>&)>& make_checks) {
  const bool is_json = format == OutputFormat::json;
  std::size_t num_failing = 0, num_checks = 0;
  Json checks = Json::array();
  const bool holds = make_checks([&](const Check& check) {
    ++num_checks;
    if (check.verdict == CheckOutcome::fails) ++num_failing;
    if (is_json) {
      checks.push_back(json_of_check(check));
      return;
    }
    write_standard_output(check_text(check, style_of(stdout).paint));
    flush_standard_output();  // The simulation may take long.
  });
  if (is_json) {
    print_json({{"file", file.string()}, {"num_failing", num_failing}, {"checks", checks}});
  }
  if (holds) return exit_done;
  wire::say(fmt::format("proofmass: error: {}: {} of {} checks {}\n", file.string(), num_failing,
                        num_checks, num_failing == 1 ? "fails" : "fail"));
  return exit_cannot_be_done;
}

void add_verify(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<VerifyCommandOptions>(
      app, chosen, "verify", "Check a database, simulate some runs again", verify_database);
  command.footer(exit_codes_text({exit_interrupted}));
  add_database(command, options.database);
  command.add_option("--fraction", options.fraction, "Fraction of the runs to simulate again")
      ->check(wire::in_range(0.0, 1.0))
      ->capture_default_str();
  add_json_flag(command, options.format);
}

}  // namespace proofmass::coordinator
