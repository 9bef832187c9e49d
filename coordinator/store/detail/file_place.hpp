#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string_view>

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
///         if it is there, or the log or the rollback journal of one that is gone, which SQLite
///         would apply to the new file, or a copy that Store::check_place() has made of it.
void check_absence(const std::filesystem::path& file);

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

  /// Looks whether the file has its name and its log, and all that was in it.
  /// @return What happened to it while it was open, in words; empty if nothing did. What happened
  ///         once stays so, whoever puts the file back.
  /// @throws StoreError if that cannot be found out now.
  std::string_view look();
  [[nodiscard]] bool is_lost() const { return !loss_.empty(); }  ///< As look() said last.
  /// Whether the file has become shorter, so that what it held is gone.
  [[nodiscard]] bool is_truncated() const;
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }  ///< Canonical.

  /// Removes the log, and its index, that lie beside the name and belong to this file: they would
  /// be applied to whatever gets the name next. A log that came with another file stays.
  void remove_own_log() const;

 private:
  /// Names a file whatever its name.
  struct Identity {
    dev_t device = 0;
    ino_t number = 0;

    bool operator==(const Identity&) const = default;
  };

  /// Of the file with this name; zeros if there is none. @throws StoreError if that is unknown.
  [[nodiscard]] static Identity identity_at(const std::filesystem::path& path);

  std::filesystem::path path_;
  int descriptor_;
  Identity file_;
  Identity log_;
  Identity index_;
  off_t size_max_ = 0;  ///< The largest that was seen: SQLite only adds pages to a campaign.
  std::string_view loss_;
};

}  // namespace proofmass::coordinator::detail
