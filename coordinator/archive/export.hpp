#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "coordinator/archive/archive_error.hpp"
#include "coordinator/archive/result_columns.hpp"
#include "coordinator/report/digest.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/run_result.hpp"
#include "proto/link/whole_file.hpp"

namespace proofmass::coordinator {

/// Text that goes to standard output as it comes, or to a file that appears when it is complete.
class TextOutput {
 public:
  /// To standard output. A reader that goes away is an error, if SIGPIPE is ignored.
  TextOutput() = default;
  /// To a file; one that has this name is replaced at the end.
  /// @throws Error `output = path (cannot be written: why)`; so do all below.
  explicit TextOutput(const std::filesystem::path& path);
  ~TextOutput();
  TextOutput(const TextOutput&) = delete;
  TextOutput& operator=(const TextOutput&) = delete;

  void write(std::string_view text);
  /// Writes what is left and gives a file its name. Without it, a file does not appear.
  void finish();
  /// The first half of finish(), for several files that are to appear together.
  void write_rest();

 private:
  void flush();
  [[noreturn]] void fail() const;

  std::optional<wire::DraftFile> file_;  ///< Nothing: standard output.
  int descriptor_ = 1;
  std::string buffer_;
};

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
// no file appears. Standard output has the results by then.

/// One line a run after a line of headings, as of RFC 4180; cells without a meaning are empty.
void export_csv(const Store& store, TextOutput& output, const IsStopped& is_stopped,
                DrawColumns draws = DrawColumns::left_out);

/// One object with campaign, columns, runs and digest; each run is an object on a line of its own,
/// with null where there is no meaning.
void export_json(const Store& store, TextOutput& output, const IsStopped& is_stopped,
                 DrawColumns draws = DrawColumns::left_out);

/// A dataset a column, the unit an attribute, NaN where there is no meaning; what defines the
/// campaign are attributes of the root. A file of this name is replaced.
void export_hdf5(const Store& store, const std::filesystem::path& file, const IsStopped& is_stopped,
                 DrawColumns draws = DrawColumns::left_out);

/// An SQLite file with the tables and views of the campaign, see Store::write_plain(). A file of
/// this name is replaced.
void export_sqlite(const Store& store, const std::filesystem::path& file,
                   const IsStopped& is_stopped);

/// walk_checked() with an end.
/// @throws Interrupted soon after `is_stopped` says so.
WalkedResults walk_results(const Store& store, const IsStopped& is_stopped,
                           const std::function<void(const RunResult&)>& visit);

}  // namespace proofmass::coordinator
