#include "coordinator/report/text_cells.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <utility>
#include <vector>

namespace proofmass::coordinator {
namespace {

constexpr std::size_t columns_max = 80;

std::string spaces(std::size_t width, std::string_view text) {
  const std::size_t taken = display_width(text);
  return std::string(width > taken ? width - taken : 0, ' ');
}

std::string without_end_blanks(std::string line) {
  line.erase(line.find_last_not_of(' ') + 1);
  return line;
}

bool is_before_line(std::span<const TextColumn> columns, std::size_t i) {
  return i + 1 < columns.size() && columns[i + 1].is_after_line;
}

/// Each group in the middle of its columns; empty if no column has one.
std::string group_line(std::span<const TextColumn> columns) {
  std::string line;
  bool has_group = false;
  for (std::size_t i = 0; i < columns.size();) {
    const std::string_view group = columns[i].group;
    if (columns[i].is_after_line) line += "│";
    std::size_t width = columns[i].width;
    while (++i < columns.size() && columns[i].group == group && !columns[i].is_after_line) {
      width += columns[i].width;
    }
    const std::string margin(spaces(width, group).size() / 2, ' ');
    line += left_aligned(margin + std::string(group), width);
    has_group = has_group || !group.empty();
  }
  return has_group ? without_end_blanks(std::move(line)) + "\n" : "";
}

}  // namespace

std::string left_aligned(std::string_view text, std::size_t width) {
  return std::string(text) + spaces(width, text);
}

std::string right_aligned(std::string_view text, std::size_t width) {
  return spaces(width, text) + std::string(text);
}

std::string wrapped(const std::string& text, std::size_t indent) {
  std::istringstream stream(text);
  std::string lines, word;
  std::size_t column = indent;
  while (stream >> word) {
    const bool is_first = column == indent;
    if (!is_first && column + 1 + display_width(word) > columns_max) {
      lines += '\n';
      lines.append(indent, ' ');
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

std::string line_of(std::string_view first, std::string_view second, std::size_t margin) {
  const bool fits = display_width(first) + 1 + display_width(second) <= columns_max;
  return fits ? fmt::format("{} {}\n", first, second)
              : fmt::format("{}\n{:{}}{}\n", first, "", margin, second);
}

std::vector<TextColumn> widened(std::span<const TextColumn> columns,
                                std::span<const std::vector<std::string>> rows,
                                std::size_t line_width_max) {
  std::vector<TextColumn> wide(columns.begin(), columns.end());
  std::size_t line_width = 0;
  for (const TextColumn& column : wide) line_width += column.width;
  for (std::size_t i = 0; i < wide.size(); ++i) {
    if (!wide[i].is_text) continue;
    std::size_t needed = wide[i].width;
    for (const auto& cells : rows) needed = std::max(needed, display_width(cells[i]) + 1);
    const std::size_t room = line_width_max > line_width ? line_width_max - line_width : 0;
    const std::size_t more = std::min(needed - wide[i].width, room);
    wide[i].width += more;
    line_width += more;
  }
  return wide;
}

std::string table_row(std::span<const TextColumn> columns, std::span<const std::string> cells,
                      WideCell wide_cell) {
  std::string text;
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const TextColumn& column = columns[i];
    const std::string cell =
        wide_cell == WideCell::keep ? cells[i] : shortened(cells[i], column.width - 1);
    if (column.is_after_line) text += "│";
    if (column.is_text) {
      text += left_aligned(cell, column.width);
    } else if (is_before_line(columns, i)) {
      text += right_aligned(cell, column.width - 1) + " ";
    } else {
      text += right_aligned(cell, column.width);
    }
  }
  return without_end_blanks(std::move(text)) + "\n";
}

std::string table_rule(std::span<const TextColumn> columns) {
  while (!columns.empty() && columns.back().title.empty())
    columns = columns.first(columns.size() - 1);
  std::string rule;
  for (const TextColumn& column : columns) {
    if (column.is_after_line) rule += "┼";
    rule += horizontal_rule(column.width);
  }
  return rule + "\n";
}

std::string table_heading(std::span<const TextColumn> columns) {
  std::vector<std::string> titles;
  for (const TextColumn& column : columns) titles.emplace_back(column.title);
  return group_line(columns) + table_row(columns, titles, WideCell::keep) + table_rule(columns);
}

std::string horizontal_rule(std::size_t count) {
  std::string rule;
  for (std::size_t i = 0; i < count; ++i) rule += "─";
  return rule;
}

std::string measured_figure(double value) {
  if (value == 0.0) return "0";
  if (value < 1e-3 || value >= 999'999.5) return fmt::format("{:.1e}", value);
  // Rounding may carry into the next decade: 9.996 is 10.0.
  const double rounded = std::stod(fmt::format("{:.2e}", value));
  const int exponent = static_cast<int>(std::floor(std::log10(rounded)));
  return fmt::format("{:.{}f}", value, std::max(0, 2 - exponent));
}

std::string signed_figure(double value) {
  return fmt::format("{}{}", value < 0.0 ? "-" : "", measured_figure(std::abs(value)));
}

std::string given_figure(double value) {
  std::string figure = measured_figure(value);
  const bool has_fraction =
      figure.find('.') != std::string::npos && figure.find('e') == std::string::npos;
  if (!has_fraction) return figure;
  figure.erase(figure.find_last_not_of('0') + 1);
  if (figure.back() == '.') figure.pop_back();
  return figure;
}

std::string duration_text(double seconds) {
  constexpr double longest_s = 9999.0 * 86400.0;
  const auto total = static_cast<std::uint64_t>(std::ceil(std::clamp(seconds, 0.0, longest_s)));
  if (total < 60) return fmt::format("{} s", total);
  if (total < 3600) return fmt::format("{} min {} s", total / 60, total % 60);
  if (total < 86400) return fmt::format("{} h {} min", total / 3600, total % 3600 / 60);
  return fmt::format("{} d {} h", total / 86400, total % 86400 / 3600);
}

}  // namespace proofmass::coordinator
