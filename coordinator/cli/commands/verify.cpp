#include <fmt/format.h>

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "coordinator/archive/verification.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/report/json.hpp"
#include "proto/command_line/option_checks.hpp"
#include "proto/link/machine.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

/// Of both commands; `verify` has no output.
struct CheckedFileOptions {
  std::filesystem::path file;    ///< A database, or the archive of one that is to be checked.
  std::filesystem::path output;  ///< Empty: the name of the database with `.tar.gz`.
  std::vector<std::string> authors{"anonymous"};
  wire::IfThere if_there = wire::IfThere::keep;
  bool is_check = false;
  /// Of the runs, simulated again; in [0, 1]. Nothing: some, if their model is here.
  std::optional<double> fraction = {};
  OutputFormat format = OutputFormat::text;
};

VerifyOptions how_to_verify(const CheckedFileOptions& options) {
  return {.fraction = options.fraction.value_or(fraction_by_default),
          .num_threads = wire::num_processors()};
}

CLI::Option* add_fraction(CLI::App& command, CheckedFileOptions& options) {
  return command
      .add_option("--fraction", options.fraction, "Fraction of the runs to simulate again")
      ->check(wire::in_range(0.0, 1.0))
      ->default_str(fmt::format("{}", fraction_by_default));
}

Json json_of_check(const Check& check) {
  return {{"name", check.name},
          {"verdict", word_for(check.verdict)},
          {"finding", check.finding},
          {"details", check.details}};
}

/// Prints checks of a file as soon as they are made, and what came of them.
/// @param make_checks  Calls its argument with each, and returns true if none fails.
int print_checks(const CheckedFileOptions& options,
                 const std::function<bool(const std::function<void(const Check&)>&)>& make_checks) {
  const std::filesystem::path& file = options.file;
  const bool is_json = options.format == OutputFormat::json;
  bool is_simulated = true;
  std::size_t num_failing = 0, num_checks = 0;
  Json checks = Json::array();
  const bool holds = make_checks([&](const Check& check) {
    ++num_checks;
    if (check.verdict == CheckOutcome::fails) ++num_failing;
    if (check.verdict == CheckOutcome::not_checked && check.name == "simulation") {
      is_simulated = false;
    }
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
  if (holds && !is_simulated && options.fraction.value_or(0.0) > 0.0) {
    wire::say(fmt::format("proofmass: error: {}: no run was simulated again, as --fraction asks\n",
                          file.string()));
    return exit_cannot_be_done;
  }
  if (holds) return exit_done;
  wire::say(fmt::format("proofmass: error: {}: {} of {} checks {}\n", file.string(), num_failing,
                        num_checks, num_failing == 1 ? "fails" : "fail"));
  return exit_cannot_be_done;
}

int verify_database(const CheckedFileOptions& options, const IsStopped& is_stopped) {
  return print_checks(options, [&](const auto& report) {
    return verify(options.file, how_to_verify(options), report, is_stopped);
  });
}

int publish_campaign(const CheckedFileOptions& options, const IsStopped& is_stopped) {
  if (options.is_check) {
    return print_checks(options, [&](const auto& report) {
      return check_publication(options.file, how_to_verify(options), report, is_stopped);
    });
  }
  std::filesystem::path output = options.output;
  if (output.empty()) output = options.file.stem().string() + ".tar.gz";
  check_output_file(output, options.if_there, "name one to replace");
  publish(options.file, output, options.if_there, options.authors, is_stopped);
  print_written(output, options.format);
  return exit_done;
}

}  // namespace

void add_verify(CLI::App& app, Command& chosen) {
  auto [command, options] = add_stoppable_command<CheckedFileOptions>(
      app, chosen, "verify", "Check a database, simulate some runs again", verify_database);
  add_database(command, options.file);
  add_fraction(command, options);
  add_json_flag(command, options.format);
}

void add_publish(CLI::App& app, Command& chosen) {
  auto [command, options] = add_stoppable_command<CheckedFileOptions>(
      app, chosen, "publish", "Write an archive to cite, or check one", publish_campaign);
  command.add_option("FILE", options.file, "Database; with --check an archive")
      ->type_name(wire::file_type)
      ->required();
  CLI::Option* const check =
      command.add_flag("--check", options.is_check, "Check an archive, simulate some runs again");
  command
      .add_option("--output", options.output, "Archive; by default FILE's stem with .tar.gz, here")
      ->type_name(wire::file_type)
      ->excludes(check);
  command.add_option("--author", options.authors, "Of the results, for citations; may be repeated")
      ->excludes(check);
  add_force_flag(command, options.if_there);
  add_fraction(command, options)->needs(check);
  add_json_flag(command, options.format);
}

}  // namespace proofmass::coordinator
