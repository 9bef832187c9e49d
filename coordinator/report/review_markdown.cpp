#include "coordinator/report/review_markdown.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "coordinator/report/review_summary.hpp"
#include "coordinator/report/review_tables.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

/// In a code span nothing is escaped but what ends it and the cell.
std::string code_span(std::string_view text) {
  std::string span;
  for (const char c : wire::visible_text(text)) {
    if (c == '|') span += '\\';
    span += c == '`' ? '\'' : c;
  }
  return "`" + span + "`";
}

std::string title_of(const ReviewColumn& column) {
  return column.group.empty() ? column.title : column.group + ": " + column.title;
}

std::string markdown_table(const ReviewTable& table) {
  std::string titles = "|";
  std::string rule = "|";
  for (const ReviewColumn& column : table.columns) {
    titles += fmt::format(" {} |", markdown_text(title_of(column)));
    rule += column.is_text ? "---|" : "---:|";
  }
  std::string text = fmt::format("**{}**\n\n{}\n{}\n", markdown_text(table.caption), titles, rule);
  for (const std::vector<ReviewCell>& row : table.rows) {
    text += "|";
    for (const ReviewCell& cell : row) {
      text += fmt::format(" {} |", markdown_text(cell.text));
    }
    text += "\n";
  }
  for (const std::string& note : table.notes) {
    if (!note.empty()) text += fmt::format("\n{}\n", markdown_text(note));
  }
  return text + "\n";
}

std::string section(std::string_view title, std::initializer_list<ReviewTable> tables) {
  std::string text;
  for (const ReviewTable& table : tables) {
    if (!table.rows.empty()) text += markdown_table(table);
  }
  return text.empty() ? "" : fmt::format("## {}\n\n{}", title, text);
}

}  // namespace

std::string markdown_text(std::string_view text) {
  constexpr std::string_view marks = "\\`*_[]<>|&~#!{}";
  std::string escaped;
  for (const char c : wire::visible_text(text)) {
    if (marks.find(c) != std::string_view::npos) escaped += '\\';
    escaped += c;
  }
  return escaped;
}

std::string review_markdown(const Review& review) {
  std::string text = fmt::format("# Campaign {}\n\n", markdown_text(review.identity.name));
  for (const auto& [sentence, source] : review_summary(review)) {
    text += fmt::format("- {} ({})\n", markdown_text(sentence), source);
  }
  text += "\n";
  text += section("Verification matrix", {matrix_table(review)}) +
          section("Accuracy", {review_accuracy_table(review), inference_table(review)}) +
          section("Budget", {review_budget_table(review)}) +
          section("Causes of the errors", {cause_table(review)}) +
          section("How it was run",
                  {identity_table(review), execution_table(review), host_table(review)}) +
          "## How to reproduce it\n\n";
  for (const auto& [command, effect] : reproducing_commands(review)) {
    text += fmt::format("- {} {}\n", code_span(command), markdown_text(effect));
  }
  return text;
}

}  // namespace proofmass::coordinator
