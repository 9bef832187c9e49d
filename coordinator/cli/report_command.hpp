#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace proofmass::coordinator {

struct ReportOptions {
  std::filesystem::path database;
  std::vector<std::string> requirements;  ///< See parse_requirement().
};

/// Prints the tables of a database's campaign, finished or not; of requirements, if there are any,
/// the answers instead.
/// @return An ExitCode; exit_not_met unless all requirements are met.
/// @throws StoreError, UsageError.
[[nodiscard]] int print_report(const ReportOptions& options);

struct SensitivityOptions {
  std::filesystem::path database;
  std::optional<std::string> parameter;  ///< Name; all by default.
  std::optional<std::uint64_t> run;      ///< To be explained.
  std::size_t num_rows = 5;              ///< Drawn quantities that are named for each error.
};

/// Prints what drives the errors, or why a run is as far off as it is.
/// @return An ExitCode.
/// @throws StoreError, UsageError if there is no such parameter, InvalidArgument.
[[nodiscard]] int print_sensitivity(const SensitivityOptions& options);

}  // namespace proofmass::coordinator
