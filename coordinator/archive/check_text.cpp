#include <fmt/format.h>

#include <array>
#include <sstream>
#include <utility>

#include "coordinator/archive/verification.hpp"
#include "coordinator/report/text_cells.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

constexpr std::size_t name_width = 12;
constexpr std::size_t verdict_width = 13;
constexpr std::size_t line_width = 80;

std::string_view word_for(Verdict verdict) {
  constexpr std::array<std::string_view, 3> words{"ok", "FAILS", "not checked"};
  return words[static_cast<std::size_t>(verdict)];
}

// Text broken between words, from the second line on after `indent` spaces.
std::string wrapped(const std::string& text, std::size_t indent) {
  std::istringstream stream(text);
  std::string lines, word;
  std::size_t column = indent;
  while (stream >> word) {
    const bool is_first = column == indent;
    if (!is_first && column + 1 + display_width(word) > line_width) {
      lines += "\n" + std::string(indent, ' ');
      column = indent;
    } else if (!is_first) {
      lines += " ";
      ++column;
    }
    lines += word;
    column += display_width(word);
  }
  return lines;
}

}  // namespace

Check Check::holds(std::string finding) {
  return {.name = {}, .verdict = Verdict::holds, .finding = std::move(finding), .details = {}};
}

Check Check::fails(std::string finding) { return fails(std::move(finding), {}); }

Check Check::fails(std::string finding, std::vector<std::string> details) {
  if (details.size() > details_named_max) {
    const std::size_t num_more = details.size() - details_named_max;
    details.resize(details_named_max);
    details.push_back(fmt::format("and {} more", num_more));
  }
  return {.name = {},
          .verdict = Verdict::fails,
          .finding = std::move(finding),
          .details = std::move(details)};
}

Check Check::not_checked(std::string finding) {
  return {
      .name = {}, .verdict = Verdict::not_checked, .finding = std::move(finding), .details = {}};
}

std::string check_text(const Check& check) {
  std::string text = left_aligned(check.name, name_width) +
                     left_aligned(word_for(check.verdict), verdict_width) +
                     wrapped(check.finding, name_width + verdict_width) + "\n";
  for (const std::string& detail : check.details) {
    text += "  " + wire::visible_text(detail) + "\n";  // It may quote the file.
  }
  return text;
}

}  // namespace proofmass::coordinator
