#include <CLI/CLI.hpp>
#include <memory>

#include "coordinator/cli/command_line.hpp"
#include "coordinator/cli/report_command.hpp"
#include "core/campaign/dispersion.hpp"

namespace proofmass::coordinator {
namespace {

void add_report(CLI::App& app, Command& chosen) {
  const auto options = std::make_shared<ReportOptions>();
  CLI::App& report = *app.add_subcommand("report", "Print the tables of a database");
  report.add_option("DB", options->database, "Database of a campaign")->required();
  report.add_option("--requirement", options->requirements,
                    "Answer instead whether it is met, as in\n"
                    "\"a_c12 < 9e-4 for 99% with 95%\"; may be repeated");
  report.callback([options, &chosen] { chosen = [options] { return print_report(*options); }; });
}

void add_sensitivity(CLI::App& app, Command& chosen) {
  const auto options = std::make_shared<SensitivityOptions>();
  CLI::App& sensitivity =
      *app.add_subcommand("sensitivity", "Print which drawn quantities drive the errors");
  sensitivity.add_option("DB", options->database, "Database of a campaign")->required();
  sensitivity.add_option("--parameter", options->parameter, "Of this parameter; all by default");
  sensitivity.add_option("--run", options->run, "Why this run is as far off as it is");
  sensitivity.add_option("--rows", options->num_rows, "Quantities to name for each error")
      ->check(CLI::Range(std::size_t{1}, num_drawn))
      ->capture_default_str();
  sensitivity.callback(
      [options, &chosen] { chosen = [options] { return print_sensitivity(*options); }; });
}

}  // namespace

void add_report_commands(CLI::App& app, Command& chosen) {
  add_report(app, chosen);
  add_sensitivity(app, chosen);
}

}  // namespace proofmass::coordinator
