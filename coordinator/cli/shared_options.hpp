#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/page/page.hpp"
#include "coordinator/store/records.hpp"

namespace proofmass::coordinator {

// Options that several commands have.

/// Declares --runs, --seed and --set.
/// @param overrides  Lives as long as the command.
void add_override_options(CLI::App& command, Overrides& overrides);

/// Why a campaign with --failures was cancelled, for standard error.
/// @param num_failures  Runs given up or without an estimate.
[[nodiscard]] std::string too_many_failures_text(std::uint64_t num_failures, std::uint64_t num_runs,
                                                 std::uint64_t failures_max);

/// A requirement about a quantity of the example, for help texts: `gain < 1e-3 for 99% with 95%`.
[[nodiscard]] std::string example_requirement();

/// Declares --until and --failures.
/// @param options  Lives as long as the command.
void add_stop_options(CLI::App& command, StopPlan& options);

/// Declares --audit.
/// @param audit_fraction  Lives as long as the command.
void add_audit_option(CLI::App& command, std::optional<double>& audit_fraction);

/// Declares `--page` and `--page-token-file`. The flag takes an address only behind a `=`, so that
/// a file name after it is not taken for one.
void add_page_options(CLI::App& app, PageConfig& page);

}  // namespace proofmass::coordinator
