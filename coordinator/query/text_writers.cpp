#include "coordinator/query/text_writers.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <utility>

#include "coordinator/query/cell_text.hpp"
#include "coordinator/query/display_text.hpp"
#include "coordinator/report/text_cells.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

constexpr std::size_t text_width_max = 100;
constexpr std::size_t text_width_min = 8;
constexpr std::string_view gap = "  ";

enum class Side : std::uint8_t { left, right };

std::string filled(std::string_view text, std::size_t width, Side side) {
  const std::size_t taken = display_width(text);
  const std::string spaces(width > taken ? width - taken : 0, ' ');
  return side == Side::right ? spaces + std::string(text) : std::string(text) + spaces;
}

void write_line(const TextSink& sink, std::string line) {
  line.erase(line.find_last_not_of(' ') + 1);
  sink(line + "\n");
}

bool is_part_of_word(std::string_view text, std::size_t position) {
  const auto is_word = [&](std::size_t i) {
    return i < text.size() && (std::isalnum(static_cast<unsigned char>(text[i])) != 0);
  };
  return position > 0 && is_word(position - 1) && is_word(position + 1);
}

// What Markdown would read as its own. An underscore inside a word is none.
std::string markdown_text(std::string_view text) {
  std::string escaped;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool is_special = std::string_view("\\|`*<[]").find(text[i]) != std::string_view::npos ||
                            (text[i] == '_' && !is_part_of_word(text, i));
    if (is_special) escaped += '\\';
    escaped += text[i];
  }
  return escaped;
}

}  // namespace

TableWriter::TableWriter(const TableLimits& limits, TextSink sink)
    : limits_(limits), sink_(std::move(sink)) {}

void TableWriter::begin(std::span<const std::string> columns) {
  for (const std::string& name : columns) {
    const std::string shown = shortened_text(wire::visible_text(name), text_width_max);
    columns_.push_back(
        {.name = shown, .width = display_width(shown), .texts = {}, .is_number = {}});
  }
}

bool TableWriter::row(std::span<const Cell> cells) {
  has_more_ = num_rows_ == limits_.num_rows_max;
  if (has_more_) return false;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    Column& column = columns_[i];
    const bool is_text = !is_number(cells[i]) && !std::holds_alternative<std::monostate>(cells[i]);
    // No more than this is ever shown, and a text may have megabytes.
    const std::string text =
        wire::visible_text(std::string_view(cell_text(cells[i])).substr(0, 1000));
    column.texts.push_back(shortened_text(text, text_width_max));
    column.is_number.push_back(is_number(cells[i]));
    column.has_text = column.has_text || is_text;
    column.width = std::max(column.width, display_width(column.texts.back()));
  }
  ++num_rows_;
  return true;
}

// Takes from the widest column of text, one at a time.
void TableWriter::fit() {
  if (!limits_.num_columns || columns_.empty()) return;
  std::size_t total = gap.size() * (columns_.size() - 1);
  for (const Column& column : columns_) total += column.width;
  const auto room = [](const Column& column) { return column.has_text ? column.width : 0; };
  while (total > *limits_.num_columns) {
    Column& widest = *std::ranges::max_element(columns_, {}, room);
    if (room(widest) <= text_width_min) return;
    --widest.width;
    --total;
  }
}

void TableWriter::write_names() {
  std::string names;
  std::string rule;
  for (const Column& column : columns_) {
    const std::string_view space = &column == &columns_.front() ? "" : gap;
    const Side side = column.has_text ? Side::left : Side::right;
    names += fmt::format("{}{}", space,
                         filled(shortened_text(column.name, column.width), column.width, side));
    rule += fmt::format("{}{}", space, horizontal_rule(column.width));
  }
  write_line(sink_, names);
  write_line(sink_, rule);
}

void TableWriter::write_row(std::size_t row) {
  std::string line;
  for (std::size_t i = 0; i < columns_.size(); ++i) {
    const Column& column = columns_[i];
    const Side side = column.is_number[row] ? Side::right : Side::left;
    if (i > 0) line += gap;
    line += filled(shortened_text(column.texts[row], column.width), column.width, side);
  }
  write_line(sink_, line);
}

void TableWriter::end() {
  if (columns_.empty()) return;
  fit();
  write_names();
  for (std::size_t row = 0; row < num_rows_; ++row) write_row(row);
  if (has_more_) sink_(fmt::format("the first {} rows (more with --rows-max)\n", num_rows_));
}

void MarkdownWriter::begin(std::span<const std::string> columns) {
  num_columns_ = columns.size();
  std::string line = "|";
  for (const std::string& name : columns)
    line += fmt::format(" {} |", markdown_text(wire::visible_text(name)));
  sink_(line + "\n");
}

void MarkdownWriter::write_rule(std::span<const Cell> cells) {
  std::string line = "|";
  for (std::size_t i = 0; i < num_columns_; ++i) {
    line += i < cells.size() && is_number(cells[i]) ? " ---: |" : " --- |";
  }
  sink_(line + "\n");
  has_rule_ = true;
}

bool MarkdownWriter::row(std::span<const Cell> cells) {
  if (!has_rule_) write_rule(cells);
  std::string line = "|";
  for (const Cell& cell : cells) {
    line += fmt::format(" {} |", markdown_text(wire::visible_text(cell_text(cell))));
  }
  sink_(line + "\n");
  return true;
}

void MarkdownWriter::end() {
  if (!has_rule_) write_rule({});
}

}  // namespace proofmass::coordinator
