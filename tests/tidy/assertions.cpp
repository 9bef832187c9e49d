#include "tests/tidy/assertions.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>

namespace proofmass::test {
namespace {

constexpr std::string_view macro = "PROOFMASS_EXPECT(";
constexpr std::string_view separator = " | ";
constexpr std::size_t reason_size_min = 20;

bool is_program(const SourceFile& file) {
  return file.is_cpp() && (file.is_in("core") || file.is_in("proto") || file.is_in("coordinator") ||
                           file.is_in("worker"));
}

/// Position of the parenthesis that closes the one before `begin`.
std::size_t closing(std::string_view code, std::size_t begin) {
  int depth = 1;
  while (begin < code.size()) {
    if (code[begin] == '(') ++depth;
    if (code[begin] == ')' && --depth == 0) break;
    ++begin;
  }
  return begin;
}

/// Text with one space wherever it has several, or the end of a line.
std::string in_one_line(std::string_view text) {
  std::string line;
  for (const char character : text) {
    const bool is_space = character == ' ' || character == '\n';
    if (!is_space) line += character;
    if (is_space && !line.empty() && line.back() != ' ') line += ' ';
  }
  return line;
}

struct Entry {
  std::string path;
  std::string condition;  ///< As `3 x condition` if there are three.
  std::string reason;
};

/// Empty path if the line is none of the table.
Entry entry_of(const std::string& line) {
  const std::size_t first = line.find(separator);
  const std::size_t last = line.rfind(separator);
  if (line.starts_with('#') || first == std::string::npos || first == last) return {};
  const std::size_t begin = first + separator.size();
  return {.path = line.substr(0, first),
          .condition = line.substr(begin, last - begin),
          .reason = line.substr(last + separator.size())};
}

/// What the table must have of each file.
std::map<std::string, std::set<std::string>> conditions_of(const std::vector<SourceFile>& files) {
  std::map<std::string, std::set<std::string>> conditions;
  for (const SourceFile& file : files) {
    std::map<std::string, int> counts;
    if (is_program(file)) {
      for (const Assertion& assertion : assertions_in(file)) ++counts[assertion.condition];
    }
    for (const auto& [condition, count] : counts) {
      conditions[file.path].insert(count == 1 ? condition
                                              : fmt::format("{} x {}", count, condition));
    }
  }
  return conditions;
}

}  // namespace

std::vector<Assertion> assertions_in(const SourceFile& file) {
  std::vector<Assertion> found;
  const std::string code = code_of(file.text);
  for (std::size_t at = code.find(macro); at != std::string::npos; at = code.find(macro, at + 1)) {
    const std::size_t line_begin = code.rfind('\n', at) + 1;
    if (code.substr(line_begin, at - line_begin).find("#define") != std::string::npos) continue;
    const std::size_t begin = at + macro.size();
    const std::size_t end = closing(code, begin);
    found.push_back(
        {.path = file.path,
         .condition = in_one_line(std::string_view(file.text).substr(begin, end - begin))});
  }
  return found;
}

Findings check_assertions(const std::vector<SourceFile>& files, std::string_view table) {
  Findings findings;
  auto missing = conditions_of(files);
  for (const std::string& line : lines_of(table)) {
    const Entry entry = entry_of(line);
    if (entry.path.empty()) {
      if (!line.empty() && !line.starts_with('#')) {
        findings.push_back("assertions.txt: no line of the table: " + line);
      }
      continue;
    }
    const auto file = missing.find(entry.path);
    const bool is_whole_file = entry.condition == "*";
    const bool is_there =
        file != missing.end() &&
        (is_whole_file ? !file->second.empty() : file->second.erase(entry.condition) > 0);
    if (is_there && is_whole_file) file->second.clear();
    if (!is_there) findings.push_back("assertions.txt: there is no such assertion: " + line);
    if (entry.reason.size() < reason_size_min) {
      findings.push_back("assertions.txt: no reason is given: " + line);
    }
  }
  for (const auto& [path, conditions] : missing) {
    for (const std::string& condition : conditions) {
      findings.push_back(fmt::format("{}: PROOFMASS_EXPECT({}) is not in tests/tidy/assertions.txt",
                                     path, condition));
    }
  }
  return findings;
}

}  // namespace proofmass::test
