#pragma once

#include <filesystem>

namespace proofmass::coordinator::detail {

/// Exclusive right to write a campaign database, held through an advisory lock on `<file>.lock`.
/// The kernel releases it when the process ends in whatever way; a file left behind holds nothing
/// back.
class StoreLock {
 public:
  /// @throws StoreError naming the holder if the lock is taken, or if the directory is not
  /// writable.
  explicit StoreLock(const std::filesystem::path& campaign_file);
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
