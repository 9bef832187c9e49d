#include "coordinator/cli/override_options.hpp"

#include <CLI/CLI.hpp>

namespace proofmass::coordinator {

void add_override_options(CLI::App& command, Overrides& overrides) {
  command.add_option("--runs", overrides.num_runs, "Number of runs; more than before extends");
  command.add_option("--seed", overrides.seed, "Seed of the campaign");
  command
      .add_option("--set", overrides.assignments,
                  "Replace a value of the file, e.g. noise.scale=0; may be repeated")
      ->take_all()
      ->allow_extra_args(false);
}

void add_audit_option(CLI::App& command, double& audit_fraction) {
  command
      .add_option("--audit", audit_fraction,
                  "Fraction of the runs to compute a second time, elsewhere, and compare")
      ->check(CLI::Range(0.0, 1.0));
}

}  // namespace proofmass::coordinator
