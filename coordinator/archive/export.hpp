#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>

#include "coordinator/archive/archive_error.hpp"
#include "coordinator/report/read_results.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/run_result.hpp"

namespace proofmass::coordinator {

/// Whether an export has the drawn values of each run. They are computed anew, as the table `draw`
/// of `proofmass query` is, which takes the memory of the campaign's table values.
enum class DrawColumns : std::uint8_t { left_out, included };

// All results of a campaign database, in run order, in formats that others read. Numbers are SI and
// keep all bits; columns are named as in the table `run_result`. README.md describes the formats.
// Memory does not grow with the runs, and a coordinator may write meanwhile: what is exported are
// the runs that were stored at one instant.
//
// With DrawColumns::included a column for each drawn quantity follows, named and in the unit of
// the table `draw` of `proofmass query`.
//
// All throw Error if the output cannot be written, StoreError if the file cannot be read or
// if its results or its definition are not those that were stored, see check_digest(),
// DefinitionError if draws are wanted of a definition that is no campaign, and Interrupted; then
// no file appears.

/// A dataset a column, the unit an attribute, NaN where there is no meaning; what defines the
/// campaign are attributes of the root. A file of this name is replaced.
void export_hdf5(const Store& store, const std::filesystem::path& file, const HeedStop& heed_stop,
                 DrawColumns draws = DrawColumns::left_out);

/// An SQLite file with the tables and views of the campaign, see Store::write_plain(). A file of
/// this name is replaced.
void export_sqlite(const Store& store, const std::filesystem::path& file,
                   const HeedStop& heed_stop);

/// A visitor of results that calls `heed_stop` now and then.
[[nodiscard]] std::function<void(const RunResult&)> stoppable(
    const HeedStop& heed_stop, std::function<void(const RunResult&)> visit);

/// walk_checked() with a stoppable visitor.
WalkedResults walk_results(const Store& store, const HeedStop& heed_stop,
                           const std::function<void(const RunResult&)>& visit);

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
///         be written; what `heed_stop` throws.
[[nodiscard]] MissingEstimates import_results(const std::filesystem::path& results,
                                              const std::filesystem::path& schema,
                                              const std::filesystem::path& database,
                                              const HeedStop& heed_stop);

}  // namespace proofmass::coordinator
