#pragma once

#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>

#include "proto/link/whole_file.hpp"

namespace proofmass::coordinator::detail {

/// Name of the network file system with this statfs(2) type, or empty if the type is none of those.
/// A write-ahead log needs memory shared by all readers and writers, so one host.
[[nodiscard]] std::string_view network_file_system_name(std::uint64_t type);

/// Name of a network file system in user space, of which statfs(2) tells nothing: `fuse.sshfs`.
///
/// @param mount_table  As in /proc/self/mountinfo.
/// @param device       `major:minor` of the directory.
[[nodiscard]] std::string network_fuse_name(std::string_view mount_table, std::string_view device);

/// @throws StoreError if new files cannot stand beside `path`: no such directory, or a network file
///         system below it.
void check_directory_of(const std::filesystem::path& path);

/// @throws StoreError with the reason unless there is a file of this name.
void check_presence(const std::filesystem::path& path);

/// Lets `write` make a file beside `path`, which then takes that name: complete or not at all, and
/// durable.
/// @throws StoreError if that cannot be done, or if the name is taken.
void appear_complete(const std::filesystem::path& path,
                     const std::function<void(const std::filesystem::path& draft)>& write);

/// Where SQLite keeps the write-ahead log of a database file: beside the file itself, also if
/// `file` is a symbolic link that leads to it.
[[nodiscard]] std::filesystem::path log_path(const std::filesystem::path& file);

/// Where SQLite puts the rollback journal of a database.
[[nodiscard]] std::filesystem::path journal_path(const std::filesystem::path& file);

/// Whether a write-ahead log with something in it lies beside the file: one that is longer than its
/// header and begins as such a log does.
[[nodiscard]] bool has_log(const std::filesystem::path& file);

/// The first thing that SQLite finds wrong with pages, rows and indices of the file alone; empty if
/// there is none. Takes some 2 s for a million runs.
[[nodiscard]] std::string fault_without_log(const std::filesystem::path& file);

/// For a file that is about to be made.
/// @throws StoreError
///         if it is there, or the log or the rollback journal of one that is gone, which SQLite
///         would apply to the new file, or a copy that Store::check_place() has made of it.
void check_absence(const std::filesystem::path& file);

/// What becomes of a lock on a file system without locks.
enum class IfNoLocks : std::uint8_t { refuse, go_on };

/// Exclusive right to write a campaign database, held through an advisory lock on `<file>.lock`.
/// The kernel releases it when the process ends in whatever way; a file left behind holds nothing
/// back.
class StoreLock {
 public:
  /// @throws StoreError naming the holder if the lock is taken, or if the directory is not
  /// writable.
  explicit StoreLock(const std::filesystem::path& campaign_file,
                     IfNoLocks if_no_locks = IfNoLocks::refuse);
  ~StoreLock();  ///< Removes the lock file.

 private:
  std::filesystem::path path_;
  wire::Descriptor descriptor_;
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
  wire::Descriptor descriptor_;
  Identity file_;
  Identity log_;
  Identity index_;
  off_t size_max_ = 0;  ///< The largest that was seen: SQLite only adds pages to a campaign.
  std::string_view loss_;
};

}  // namespace proofmass::coordinator::detail
