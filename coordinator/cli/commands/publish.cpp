#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "coordinator/archive/publication.hpp"
#include "coordinator/cli/commands/verify.hpp"
#include "coordinator/cli/output.hpp"
#include "coordinator/cli/stop_signals.hpp"
#include "proto/command_line/option_checks.hpp"
#include "proto/link/machine.hpp"

namespace proofmass::coordinator {
namespace {

struct PublishOptions {
  std::filesystem::path file;    ///< The database, or the archive that is to be checked.
  std::filesystem::path output;  ///< Empty: the name of the database with `.tar.gz`.
  std::vector<std::string> authors{"anonymous"};
  wire::IfThere if_there = wire::IfThere::keep;
  bool is_check = false;
  double fraction = 0.01;  ///< Of the runs, simulated again; in [0, 1].
  OutputFormat format = OutputFormat::text;
};

int publish_campaign(const PublishOptions& options) {
  std::filesystem::path output = options.output;
  if (output.empty()) output = options.file.stem().string() + ".tar.gz";
  if (!options.is_check) check_output_file(output, options.if_there, "name one to replace");
  return run_until_stopped([&](const IsStopped& is_stopped) {
    const VerifyOptions how{.fraction = options.fraction, .num_threads = wire::num_processors()};
    if (options.is_check) {
      return print_checks(options.file, options.format, [&](const auto& report) {
        return check_publication(options.file, how, report, is_stopped);
      });
    }
    publish(options.file, output, options.if_there, options.authors, is_stopped);
    if (options.format == OutputFormat::json) {
      print_json({{"file", output.string()}});
    } else {
      print_lines(fmt::format("wrote {}\n", output.string()));
    }
    return int{exit_done};
  });
}

}  // namespace

void add_publish(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<PublishOptions>(
      app, chosen, "publish", "Write an archive to cite, or check one", publish_campaign);
  command.footer(exit_codes_text({exit_interrupted}));
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
  command.add_option("--fraction", options.fraction, "Fraction of the runs to simulate again")
      ->check(wire::in_range(0.0, 1.0))
      ->needs(check)
      ->capture_default_str();
  add_json_flag(command, options.format);
}

}  // namespace proofmass::coordinator
