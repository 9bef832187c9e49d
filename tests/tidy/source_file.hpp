#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace proofmass::test {

/// A file of the repository.
struct SourceFile {
  std::string path;  ///< From the root: `core/signal/window.hpp`.
  std::string text;

  [[nodiscard]] bool is_header() const { return path.ends_with(".hpp"); }
  [[nodiscard]] bool is_cpp() const { return is_header() || path.ends_with(".cpp"); }
  [[nodiscard]] bool is_in(std::string_view folder) const {
    return path.starts_with(std::string(folder) + "/");
  }
};

/// All sources, schemas, scripts and CMakeLists of the repository, by path.
[[nodiscard]] std::vector<SourceFile> read_sources(const std::filesystem::path& root);

/// C++ text with comments and the inside of literals blanked; lines and columns stay.
[[nodiscard]] std::string code_of(std::string_view text);

/// Lines without their ends.
[[nodiscard]] std::vector<std::string> lines_of(std::string_view text);

}  // namespace proofmass::test
