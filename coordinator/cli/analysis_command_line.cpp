#include <CLI/CLI.hpp>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <string>

#include "coordinator/cli/command_line.hpp"
#include "coordinator/cli/query_command.hpp"
#include "coordinator/cli/report_command.hpp"
#include "core/campaign/dispersion.hpp"
#include "core/campaign/identifiers.hpp"
#include "core/campaign/model.hpp"
#include "proto/command_line/option_checks.hpp"

namespace proofmass::coordinator {
namespace {

constexpr double timeout_s_max = 86'400.0;
constexpr std::size_t table_rows_max = 1'000'000;

// Each command shares its options with the callback that CLI11 keeps and with the chosen command.

void add_report(CLI::App& app, Command& chosen) {
  const auto options = std::make_shared<ReportOptions>();
  CLI::App& report = *app.add_subcommand("report", "Print the tables of a database");
  report.add_option("DB", options->database, "Database of a campaign")->required();
  report.add_option("--requirement", options->requirements,
                    "Answer instead whether it is met, as in\n"
                    "\"a_c12 < 9e-4 for 99% with 95%\" or\n"
                    "\"all objectives for 95% with 90%\"; may be repeated");
  report.callback([options, &chosen] { chosen = [options] { return print_report(*options); }; });
}

void add_sensitivity(CLI::App& app, Command& chosen) {
  const auto options = std::make_shared<SensitivityOptions>();
  CLI::App& sensitivity =
      *app.add_subcommand("sensitivity", "Print which drawn quantities drive the errors");
  sensitivity.add_option("DB", options->database, "Database of a campaign")->required();
  sensitivity.add_option("--parameter", options->parameter, "Of this parameter; all by default");
  sensitivity.add_option("--run", options->run, "Why this run is as far off as it is")
      ->check(wire::in_range(std::uint64_t{0}, num_runs_max - 1));
  sensitivity.add_option("--rows", options->num_rows, "Quantities to name for each error")
      ->check(wire::in_range(std::size_t{1},
                             model().drawn().size() + model().results().quantities.size()))
      ->capture_default_str();
  sensitivity.callback(
      [options, &chosen] { chosen = [options] { return print_sensitivity(*options); }; });
}

void add_query(CLI::App& app, Command& chosen) {
  static const std::map<std::string, RowFormat> formats{{"table", RowFormat::table},
                                                        {"csv", RowFormat::csv},
                                                        {"json", RowFormat::json},
                                                        {"markdown", RowFormat::markdown}};
  const auto options = std::make_shared<QueryOptions>();
  CLI::App& query = *app.add_subcommand("query", "Ask a database a question in SQL");
  query.add_option("DB", options->database, "Database of a campaign")->required();
  query.add_option("SQL", options->sql, "One statement that reads; - for standard input")
      ->required();
  query
      .add_option("--attach", options->attached,
                  "NAME=FILE: another campaign, whose tables are\n"
                  "NAME.run_result and so on; may be repeated")
      ->allow_extra_args(false);
  wire::add_choice(query, "--format", options->format, formats,
                   "table, csv, json or markdown; table by default");
  query.add_option("--timeout", options->timeout_s, "Seconds that it may take")
      ->check(wire::in_range(0.001, timeout_s_max))
      ->capture_default_str();
  query.add_option("--rows-max", options->num_rows_max, "Rows that a table shows")
      ->check(wire::in_range(std::size_t{1}, table_rows_max))
      ->capture_default_str();
  query.callback([options, &chosen] { chosen = [options] { return query_database(*options); }; });
}

}  // namespace

void add_analysis_commands(CLI::App& app, Command& chosen) {
  add_report(app, chosen);
  add_sensitivity(app, chosen);
  add_query(app, chosen);
}

}  // namespace proofmass::coordinator
