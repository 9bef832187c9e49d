#pragma once

#include <filesystem>

namespace proofmass::coordinator {

/// A file that appears under its name complete, or not at all: it is written beside it, as
/// `<name>.PROCESS.new`, and gets its name at the end.
class DraftFile {
 public:
  /// @param path  Name that the file is to have; a file that has it already is replaced.
  explicit DraftFile(std::filesystem::path path);
  ~DraftFile();  ///< Removes the draft unless it was published.
  DraftFile(const DraftFile&) = delete;
  DraftFile& operator=(const DraftFile&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  /// Where to write to.
  [[nodiscard]] const std::filesystem::path& draft() const { return draft_; }

  /// Makes the draft durable and gives it its name. @pre Whoever wrote it has closed it.
  /// @throws ArchiveError `output = path (cannot be written: why)`.
  void publish();

 private:
  std::filesystem::path path_;
  std::filesystem::path draft_;
  bool is_published_ = false;
};

/// @throws ArchiveError `output = path (cannot be written: why)` for an errno.
[[noreturn]] void fail_to_write(const std::filesystem::path& path, int error_number);

}  // namespace proofmass::coordinator
