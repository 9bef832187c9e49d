#pragma once

#include <cstdint>
#include <filesystem>
#include <string_view>

namespace proofmass::coordinator {

/// What becomes of a file that has the name already.
enum class IfThere : std::uint8_t { keep, replace };

/// A file that appears under its name complete, or not at all: something writes it beside that
/// name, and publish() gives it the name. For what needs a path or does not fit into memory;
/// otherwise see wire::write_whole_file().
class DraftFile {
 public:
  /// @param path    Name that the file is to have.
  /// @param ending  What follows it in the name of the draft.
  DraftFile(std::filesystem::path path, std::string_view ending);
  ~DraftFile();  ///< Removes the draft unless it was published.
  DraftFile(const DraftFile&) = delete;
  DraftFile& operator=(const DraftFile&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  /// Where to write to. A draft that a killed process left there is gone.
  [[nodiscard]] const std::filesystem::path& draft() const { return draft_; }

  /// Makes the draft durable and gives it its name. The name itself is durable after
  /// synchronise_directory_of(). @pre The draft is closed.
  /// @returns 0 or an errno.
  [[nodiscard]] int publish(IfThere if_there);

 private:
  std::filesystem::path path_;
  std::filesystem::path draft_;
  bool is_published_ = false;
};

/// Makes a finished file durable and gives it its name, which is durable after
/// synchronise_directory_of().
/// @returns 0 or an errno.
[[nodiscard]] int publish_file(const std::filesystem::path& draft,
                               const std::filesystem::path& path, IfThere if_there);

/// Directory of a path; the working directory for a mere name.
[[nodiscard]] std::filesystem::path directory_of(const std::filesystem::path& path);

/// Makes the name of a file durable. @returns 0 or an errno.
[[nodiscard]] int synchronise_directory_of(const std::filesystem::path& path);

}  // namespace proofmass::coordinator
