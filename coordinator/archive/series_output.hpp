#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "coordinator/archive/archive_error.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/recording.hpp"
#include "core/campaign/run_result.hpp"

namespace proofmass::coordinator {

/// What of a recording goes to files: all of it, or some sessions and groups of signals.
class SignalSelection {
 public:
  /// A group, and where its signals are among the values of a sample.
  struct Group {
    const SignalGroup* info;
    std::size_t first_value;
  };

  /// @param recording         Outlives this.
  /// @param sessions, groups  Names; none for all.
  /// @throws InvalidArgument `session = third (must be one of first, second)`.
  SignalSelection(const Recording& recording, std::span<const std::string> sessions,
                  std::span<const std::string> groups);

  [[nodiscard]] const Recording& recording() const { return *recording_; }
  /// @param session  Index in Recording::sessions.
  [[nodiscard]] bool has_session(std::size_t session) const { return has_session_[session]; }
  /// In the order of the recording.
  [[nodiscard]] const std::vector<Group>& groups() const { return groups_; }

 private:
  const Recording* recording_;
  std::vector<bool> has_session_;
  std::vector<Group> groups_;
};

/// What files with time series say of the run that these are of.
struct SeriesOrigin {
  const Store& store;
  RunResult result;             ///< The stored one.
  std::string program_version;  ///< Of this program.
};

/// Files with the time series of one run.
class SeriesOutput {
 public:
  virtual ~SeriesOutput() = default;

  /// Takes the samples of SampleSink. What is not selected is left out.
  /// @throws ArchiveError `output = path (cannot be written: why)`; so does finish().
  virtual void add(const RecordedSample& sample) = 0;
  /// Gives the files their names. Without it none appears.
  virtual void finish() = 0;

 protected:
  SeriesOutput() = default;
  SeriesOutput(const SeriesOutput&) = delete;
  SeriesOutput& operator=(const SeriesOutput&) = delete;
};

// Both replace files of the same name; README.md describes the formats. Memory does not grow with
// the samples.

/// One HDF5 file: a group a session, in it a compound dataset for each group of signals.
/// @param selection  Outlives the output.
[[nodiscard]] std::unique_ptr<SeriesOutput> hdf5_series(const std::filesystem::path& file,
                                                        const SeriesOrigin& origin,
                                                        const SignalSelection& selection);

/// A CSV file for each session, see csv_series_file().
/// @param directory  Exists.
/// @param selection  Outlives the output.
[[nodiscard]] std::unique_ptr<SeriesOutput> csv_series(const std::filesystem::path& directory,
                                                       RunIndex run,
                                                       const SignalSelection& selection);

/// `DIRECTORY/run42_SESSION.csv`.
[[nodiscard]] std::filesystem::path csv_series_file(const std::filesystem::path& directory,
                                                    RunIndex run, const RecordedSession& session);

}  // namespace proofmass::coordinator
