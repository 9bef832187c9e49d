#include "coordinator/cli/shared_options.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>

#include "coordinator/cli/program.hpp"
#include "core/definition/definition_text.hpp"
#include "core/error.hpp"
#include "core/model.hpp"
#include "core/result_rules.hpp"
#include "core/runs.hpp"
#include "proto/command_line/option_checks.hpp"

namespace proofmass::coordinator {

void add_override_options(CLI::App& command, Overrides& overrides) {
  command.add_option("--runs", overrides.num_runs, "Number of runs; more than before extends")
      ->check(wire::in_range(std::uint64_t{1}, num_runs_max));
  command.add_option("--seed", overrides.seed, "Seed of the campaign")
      ->check(wire::in_range(std::uint64_t{0}, seed_max));
  command
      .add_option("--set", overrides.assignments,
                  "Replace a value of the file: TABLE.KEY=VALUE;\nmay be repeated")
      ->take_all()
      ->allow_extra_args(false);
  command.add_flag_callback(
      "--tolerate-digest",
      [&overrides] { overrides.assignments.emplace_back("campaign.tolerate_digest=true"); },
      "Accept machines where a model program computes\nother bits; the report says so");
}

std::string too_many_failures_text(std::uint64_t num_failures, std::uint64_t num_runs,
                                   std::uint64_t failures_max) {
  return fmt::format(
      "proofmass: error: {} of {} runs given up or without an estimate (at most {} with "
      "--failures); cancelled\n",
      num_failures, num_runs, failures_max);
}

std::string example_requirement() {
  const Quantity quantity = example_quantity(example_results());
  const double limit =
      std::isfinite(quantity.objective) ? quantity.objective : quantity.display_scale;
  return fmt::format("{} < {} for 99% with 95%", quantity.name,
                     proofmass::detail::number_text(limit));
}

void add_stop_options(CLI::App& command, StopPlan& options) {
  command.add_option("--until", options.stop_rule,
                     fmt::format("Stop as soon as the rule holds, as in\n\"std({}) within 5%\",\n"
                                 "\"all objectives within 2%\" or\n\"{} decided\"",
                                 example_quantity(example_results()).name, example_requirement()));
  command
      .add_option("--failures", options.failures_max,
                  "Cancel when more runs than this lack an estimate")
      ->check(wire::in_range(std::uint64_t{0}, num_runs_max));
}

void add_audit_option(CLI::App& command, std::optional<double>& audit_fraction) {
  command
      .add_option("--audit", audit_fraction,
                  "Fraction of the runs to compute a second time,\nelsewhere, and compare")
      ->check(wire::in_range(0.0, 1.0));
}

void add_page_options(CLI::App& app, PageConfig& page) {
  app.add_flag("--page", page.address,
               "Serve the live page, at 127.0.0.1:5557 or at\n--page=HOST:PORT")
      ->envname("PROOFMASS_PAGE");
  app.add_option("--page-token-file", page.token_file,
                 "File with a secret that visitors of the page\nmust show; needed beyond loopback")
      ->type_name(wire::file_type)
      ->envname("PROOFMASS_PAGE_TOKEN_FILE");
}

}  // namespace proofmass::coordinator
