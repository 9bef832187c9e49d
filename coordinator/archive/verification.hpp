#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "coordinator/archive/archive_error.hpp"
#include "coordinator/table/table.hpp"
#include "proto/link/whole_file.hpp"

namespace proofmass::coordinator {

enum class CheckOutcome : std::uint8_t {
  holds,
  fails,
  not_checked,  ///< Another check failed that it needs, or the file does not tell.
};

/// Of the runs, simulated again if nobody asks for another.
inline constexpr double fraction_by_default = 0.01;

/// Details that a Check names of many.
inline constexpr std::size_t details_named_max = 10;

struct Check {
  std::string_view name = {};  ///< `integrity`, `digest` ...
  CheckOutcome verdict = CheckOutcome::holds;
  std::string finding = {};               ///< What was found, in a line.
  std::vector<std::string> details = {};  ///< Further lines.

  // Checks without a name yet.
  [[nodiscard]] static Check holds(std::string finding) { return {.finding = std::move(finding)}; }
  /// Names the first ten of the details and counts the others, and those that are not among them.
  [[nodiscard]] static Check fails(std::string finding, std::vector<std::string> details = {},
                                   std::uint64_t num_further = 0);
  [[nodiscard]] static Check not_checked(std::string finding) {
    return {.verdict = CheckOutcome::not_checked, .finding = std::move(finding)};
  }
};

/// How much is checked, and against what.
struct VerifyOptions {
  /// Of the finished runs, simulated again; in [0, 1], one at least.
  double fraction = fraction_by_default;
  std::size_t num_threads = 1;          ///< That draw and simulate; at least 1.
  std::string_view model_version = {};  ///< The model that simulates; empty: Store::model().
};

/// Checks whether a campaign database is whole and holds what its definition yields, in this order:
/// file, integrity, definition, model, results, digest, statistics, stop_checks, audit, draws,
/// simulation.
/// Of a model that is known by its description alone, runs are drawn and not simulated again.
/// A check that fails ends none of the others that can still be made. Nothing is written, and a
/// coordinator may write meanwhile.
///
/// @param report  Called with each check as soon as it is made.
/// @throws ArchiveError if there is no such file or it is no campaign database; Interrupted.
void verify(const std::filesystem::path& file, const VerifyOptions& options,
            const std::function<void(const Check&)>& report, const HeedStop& heed_stop);

/// `ok`, `FAILS` or `not checked`.
[[nodiscard]] std::string_view word_for(CheckOutcome verdict);

/// A check as text: a line, then one for each detail; at most 80 characters each unless a detail
/// has no place to break.
[[nodiscard]] std::string check_text(const Check& check, Paint paint = Paint::no);

/// Writes an archive (tar, gzip) with which others can check, repeat and cite a campaign: README.md
/// lists its files. It is of one state of the database, which a coordinator may be writing to. The
/// same database gives the same bytes.
///
/// @param authors  For the citation.
/// @throws StoreError if the database cannot be read or is damaged; DefinitionError or ArchiveError
///         if this program cannot make its campaign again; Error if the archive cannot be written;
///         Interrupted. Then no file appears.
void publish(const std::filesystem::path& database, const std::filesystem::path& archive,
             wire::IfThere if_there, std::span<const std::string> authors,
             const HeedStop& heed_stop);

/// Checks an archive from elsewhere: `checksums`, `campaign`, then all of verify(). It is unpacked
/// to the temporary directory, where nothing of it remains.
///
/// @param report  As of verify().
/// @throws ArchiveError `archive = FILE (why)` if it is not one folder with plain files, is damaged
///         or unpacks to over 256 MiB and 64 times its size; Interrupted.
void check_publication(const std::filesystem::path& archive, const VerifyOptions& options,
                       const std::function<void(const Check&)>& report, const HeedStop& heed_stop);

}  // namespace proofmass::coordinator
