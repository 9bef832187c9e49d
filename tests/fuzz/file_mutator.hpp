#pragma once

#include <cstdint>
#include <filesystem>
#include <random>
#include <string>
#include <vector>

namespace proofmass::test {

/// Makes campaign databases from others that a disk, a crash, an editor or an enemy could have
/// made. The same seed makes the same file.
class FileMutator {
 public:
  explicit FileMutator(std::uint64_t seed) : random_(seed) {}

  /// Writes a changed copy of one of the files.
  void make(const std::vector<std::filesystem::path>& originals, const std::filesystem::path& file);

  /// A text with some bytes, words and lines changed.
  [[nodiscard]] std::string changed_text(std::string text);

  [[nodiscard]] std::size_t below(std::size_t bound) { return random_() % bound; }

 private:
  void change_bytes(std::string& bytes);
  void change_page(std::string& bytes);
  /// By SQL, with the checks switched off.
  void change_rows(const std::filesystem::path& file);
  [[nodiscard]] std::string change_of_schema(const std::string& table);
  [[nodiscard]] std::string value();

  std::mt19937_64 random_;
};

}  // namespace proofmass::test
