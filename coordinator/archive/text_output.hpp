#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "coordinator/archive/draft_file.hpp"

namespace proofmass::coordinator {

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
