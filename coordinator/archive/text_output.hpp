#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

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

  /// Makes the draft durable and gives it its name. @pre The draft is closed.
  /// @throws ArchiveError `output = path (cannot be written: why)`.
  void publish();

 private:
  std::filesystem::path path_;
  std::filesystem::path draft_;
  bool is_published_ = false;
};

/// @throws ArchiveError `output = path (cannot be written: why)` for an errno.
[[noreturn]] void fail_to_write(const std::filesystem::path& path, int error_number);

/// Text that goes to standard output as it comes, or to a file that appears when it is complete.
class TextOutput {
 public:
  /// To standard output. A reader that goes away is an error, if SIGPIPE is ignored.
  TextOutput() = default;
  /// To a file; one that has this name is replaced at the end.
  /// @throws ArchiveError `output = path (cannot be written: why)`; so do all below.
  explicit TextOutput(const std::filesystem::path& path);
  ~TextOutput();
  TextOutput(const TextOutput&) = delete;
  TextOutput& operator=(const TextOutput&) = delete;

  void write(std::string_view text);
  /// Writes what is left. Without it, a file does not appear.
  void finish();

 private:
  void flush();
  [[nodiscard]] std::filesystem::path name() const;

  std::optional<DraftFile> file_;  ///< Nothing: standard output.
  int descriptor_ = 1;
  std::string buffer_;
};

}  // namespace proofmass::coordinator
