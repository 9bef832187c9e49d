#include "coordinator/table/markdown_table.hpp"

#include <fmt/format.h>

#include <cctype>
#include <cstddef>

#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

bool is_inside_word(std::string_view text, std::size_t position) {
  const auto is_word = [&](std::size_t i) {
    return i < text.size() && std::isalnum(static_cast<unsigned char>(text[i])) != 0;
  };
  return position > 0 && is_word(position - 1) && is_word(position + 1);
}

std::string title_of(const Column& column) {
  return column.group.empty() ? column.title : column.group + ": " + column.title;
}

}  // namespace

std::string markdown_text(std::string_view text) {
  constexpr std::string_view marks = "\\`*[]<>|&~#!{}";
  const std::string visible = wire::visible_text(text);
  std::string escaped;
  for (std::size_t i = 0; i < visible.size(); ++i) {
    const bool is_mark = marks.find(visible[i]) != std::string_view::npos ||
                         (visible[i] == '_' && !is_inside_word(visible, i));
    if (is_mark) escaped += '\\';
    escaped += visible[i];
  }
  return escaped;
}

std::string markdown_heading(std::span<const Column> columns) {
  std::string titles = "|", rule = "|";
  for (const Column& column : columns) {
    titles += fmt::format(" {} |", markdown_text(title_of(column)));
    rule += column.is_text ? " --- |" : " ---: |";
  }
  return titles + "\n" + rule + "\n";
}

std::string markdown_row(std::span<const Cell> cells) {
  std::string line = "|";
  for (const Cell& cell : cells) line += fmt::format(" {} |", markdown_text(cell.in_document()));
  return line + "\n";
}

std::string markdown_table(const Table& table) {
  std::string text =
      fmt::format("**{}**\n\n", markdown_text(table.caption)) + markdown_heading(table.columns);
  for (const Row& row : table.rows) text += markdown_row(row);
  for (const Remark& remark : table.remarks)
    text += fmt::format("\n{}\n", markdown_text(remark.text));
  for (const std::string& note : table.notes) {
    if (!note.empty()) text += fmt::format("\n{}\n", markdown_text(note));
  }
  return text + "\n";
}

}  // namespace proofmass::coordinator
