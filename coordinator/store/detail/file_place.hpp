#pragma once

#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <string>

#include "coordinator/store/detail/database.hpp"

namespace proofmass::coordinator::detail {

/// Where SQLite keeps the write-ahead log of a database file: beside the file itself, also if
/// `file` is a symbolic link that leads to it.
[[nodiscard]] std::filesystem::path log_path(const std::filesystem::path& file);

/// Where SQLite puts the rollback journal of a database.
[[nodiscard]] std::filesystem::path journal_path(const std::filesystem::path& file);

/// Whether a write-ahead log with something in it lies beside the file: one that is longer than its
/// header and begins as such a log does.
[[nodiscard]] bool has_log(const std::filesystem::path& file);

/// Whether SQLite finds nothing wrong with the pages and rows of the file alone. Takes some 1 s for
/// a million runs.
[[nodiscard]] bool is_sound_without_log(const std::filesystem::path& file);

/// For a file that is about to be made.
/// @throws StoreError
///         if it is there, or the log or the rollback journal of one that is gone: SQLite would
///         apply that to the new file.
void check_absence(const std::filesystem::path& file);

/// Where the open file of a coordinator is now.
enum class Placement : std::uint8_t {
  in_place,
  removed,            ///< Nothing has its name any more: it was removed or renamed.
  replaced,           ///< Another file has its name.
  log_removed,        ///< It has its name, but its write-ahead log has not.
  truncated,          ///< It is shorter than it was: somebody has emptied it or written over it.
  without_directory,  ///< Its directory was removed or renamed.
};

/// Holds an open campaign database by the file itself, whatever becomes of its name: no two
/// coordinators have one file, also where both lock files were removed. The advisory lock ends with
/// the process.
///
/// Constructed before a connection to the file is opened and destroyed after it is closed: closing
/// it ends the locks that SQLite has on the file in this process.
class FilePlace {
 public:
  /// @throws StoreError if another coordinator has the file.
  explicit FilePlace(const std::filesystem::path& file);
  ~FilePlace();
  FilePlace(const FilePlace&) = delete;
  FilePlace& operator=(const FilePlace&) = delete;

  /// To be called once the connection has opened the write-ahead log.
  void remember_log();

  /// A file that was truncated once stays so: what was cut off does not come back.
  [[nodiscard]] Placement look();
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }  ///< Canonical.

  /// Whether the log that lies beside the name belongs to this file.
  [[nodiscard]] bool has_own_log() const;

  /// Removes the log, and its index, that lie beside the name and belong to this file. A log that
  /// came with another file stays.
  ///
  /// Whatever opens a file of this name with its log must come afterwards: it would share the
  /// index, and empty it, since SQLite takes no lock of its own process for that of another user.
  /// @throws StoreError if one of them cannot be removed.
  void remove_own_log() const;

 private:
  /// Names a file whatever its name.
  struct Identity {
    dev_t device = 0;
    ino_t number = 0;

    bool operator==(const Identity&) const = default;
  };

  /// Of the file with this name; zeros if there is none.
  [[nodiscard]] static Identity identity_at(const std::filesystem::path& path);

  std::filesystem::path path_;
  int descriptor_;
  Identity file_;
  Identity log_;
  Identity index_;
  off_t size_max_ = 0;  ///< The largest that was seen: SQLite only adds pages to a campaign.
  bool is_truncated_ = false;
};

/// Removes the write-ahead log and its index that lie beside this canonical name, whosever they
/// are.
/// @throws StoreError if one of them cannot be removed.
void remove_log_of(const std::filesystem::path& file);

/// Whether an open file needs its write-ahead log.
enum class OwnLog : std::uint8_t {
  folded_in,  ///< The file itself has all that is stored.
  needed,     ///< Results may be in the log only.
};

/// Writes the open file to the name that it has lost, complete or not at all.
///
/// The write-ahead log of the open file would be applied to whatever has the name next. If it is
/// folded in, it is removed first, and else when the copy that gets the name is complete.
/// @param placement  `removed`: the name must still be free. `replaced`: what has the name now must
///                   be an older copy of the same campaign, none of whose results differ; the
///                   open file has all that is in it, and takes its place.
/// @throws StoreError with the reason if that cannot be done; the open file is as it was.
void restore_name(const std::filesystem::path& path, Database& open_file, const FilePlace& place,
                  Placement placement, OwnLog own_log);

}  // namespace proofmass::coordinator::detail
