#pragma once

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
/// @throws StoreError if that cannot be done, or if the name is taken and is to be kept.
void appear_complete(const std::filesystem::path& path, wire::IfThere if_there,
                     const std::function<void(const std::filesystem::path& draft)>& write);

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
  /// Whether the lock file still has its name, without which it keeps nobody away.
  [[nodiscard]] bool is_in_place() const;
  StoreLock(const StoreLock&) = delete;
  StoreLock& operator=(const StoreLock&) = delete;

 private:
  std::filesystem::path path_;
  int descriptor_;
};

}  // namespace proofmass::coordinator::detail
