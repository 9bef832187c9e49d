#include "tests/tidy/source_file.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <fstream>
#include <iterator>

namespace proofmass::test {
namespace {

constexpr std::array<std::string_view, 7> folders{"core",   "proto", "coordinator", "worker",
                                                  "deploy", "tests", ".ci"};
constexpr std::array<std::string_view, 6> suffixes{".hpp", ".cpp", ".proto", ".sql", ".sh", "run"};

bool is_source(const std::filesystem::path& file) {
  const std::string name = file.filename().string();
  return name == "CMakeLists.txt" || std::ranges::any_of(suffixes, [&](std::string_view suffix) {
           return name == suffix || (suffix.starts_with('.') && name.ends_with(suffix));
         });
}

SourceFile read_source(const std::filesystem::path& root, const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::filesystem::relative(file, root).generic_string(),
          {std::istreambuf_iterator<char>(stream), {}}};
}

/// Blanks comments and literals in one pass.
class Blanker {
 public:
  explicit Blanker(std::string_view text) : text_(text) {}

  std::string run() {
    while (!rest_is_empty()) {
      if (at("//"))
        blank_until("\n", 0);
      else if (at("/*"))
        blank_until("*/", 2);
      else if (at("R\""))
        blank_raw_string();
      else if (at("\""))
        blank_literal('"');
      else if (at("'") && !is_digit_separator())
        blank_literal('\'');
      else
        keep();
    }
    return code_;
  }

 private:
  [[nodiscard]] bool rest_is_empty() const { return code_.size() == text_.size(); }
  [[nodiscard]] std::string_view rest() const { return text_.substr(code_.size()); }
  [[nodiscard]] bool at(std::string_view start) const { return rest().starts_with(start); }

  [[nodiscard]] bool is_digit_separator() const {
    return !code_.empty() && std::isxdigit(static_cast<unsigned char>(code_.back())) != 0;
  }

  void keep() { code_ += rest().front(); }

  void blank(std::size_t count) {
    for (std::size_t i = 0; i < count && !rest_is_empty(); ++i) {
      code_ += rest().front() == '\n' ? '\n' : ' ';
    }
  }

  void blank_until(std::string_view end, std::size_t end_size) {
    const std::size_t position = rest().find(end, 1);
    blank(position == std::string_view::npos ? rest().size() : position + end_size);
  }

  void blank_raw_string() {
    const std::size_t parenthesis = rest().find('(');
    std::string end(1, ')');
    end.append(rest().substr(2, parenthesis - 2)).append("\"");
    blank_until(end, end.size());
  }

  void blank_literal(char quote) {
    std::size_t size = 1;
    while (size < rest().size() && rest()[size] != quote && rest()[size] != '\n') {
      size += rest()[size] == '\\' ? 2u : 1u;
    }
    blank(size + 1);
  }

  std::string_view text_;
  std::string code_;
};

}  // namespace

std::vector<SourceFile> read_sources(const std::filesystem::path& root) {
  std::vector<SourceFile> sources{read_source(root, root / "CMakeLists.txt")};
  for (const std::string_view folder : folders) {
    if (!std::filesystem::exists(root / folder)) continue;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(root / folder)) {
      if (entry.is_regular_file() && is_source(entry.path())) {
        sources.push_back(read_source(root, entry.path()));
      }
    }
  }
  std::ranges::sort(sources, {}, &SourceFile::path);
  return sources;
}

std::string code_of(std::string_view text) { return Blanker(text).run(); }

std::vector<std::string> lines_of(std::string_view text) {
  std::vector<std::string> lines;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    lines.emplace_back(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return lines;
}

}  // namespace proofmass::test
