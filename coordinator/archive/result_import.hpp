#pragma once

#include <filesystem>

#include "coordinator/archive/archive_error.hpp"
#include "coordinator/report/read_results.hpp"

namespace proofmass::coordinator {

/// Makes a campaign database of truths and estimates that another program computed, complete or not
/// at all: what needs no simulation is done with it as with any other.
///
/// @param results   Comma-separated values, a line a run after one of headings. The run of a line
///                  without any number for an estimate is lost; that of one where some estimate
///                  or standard error is no number is not finite.
/// @param schema    TOML that says what the columns are, see README.md.
/// @param database  A new file.
/// @return How many runs have no estimate, and why.
/// @throws DefinitionError naming file, line and rule; StoreError if the database exists or cannot
///         be written; what `is_stopped` throws.
[[nodiscard]] MissingEstimates import_results(const std::filesystem::path& results,
                                              const std::filesystem::path& schema,
                                              const std::filesystem::path& database,
                                              const IsStopped& is_stopped);

}  // namespace proofmass::coordinator
