#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstddef>
#include <string_view>
#include <utility>

#include "coordinator/table/table.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

using wire::markup_text;

std::string_view text_class(const Column& column) {
  return column.is_text ? " class=\"words\"" : "";
}

std::string_view class_of(Tone tone) {
  if (tone == Tone::good) return "met";
  if (tone == Tone::bad) return "unmet";
  return tone == Tone::open ? "open" : "";
}

std::string group_line(const Table& table) {
  std::string line;
  bool has_groups = false;
  for (std::size_t i = 0; i < table.columns.size();) {
    std::size_t end = i + 1;
    const std::string& group = table.columns[i].group;
    while (!group.empty() && end < table.columns.size() && table.columns[end].group == group &&
           !table.columns[end].is_after_line) {
      ++end;
    }
    has_groups |= !group.empty();
    line += group.empty() ? "<td></td>"
                          : fmt::format("<th scope=\"colgroup\" colspan=\"{}\">{}</th>", end - i,
                                        markup_text(group));
    i = end;
  }
  return has_groups ? "<tr>" + line + "</tr>\n" : "";
}

std::string title_line(const Table& table) {
  std::string line;
  for (const Column& column : table.columns) {
    const std::string sort =
        column.sort.empty() ? "" : fmt::format(" aria-sort=\"{}\"", column.sort);
    line += fmt::format("<th scope=\"col\"{}{}>{}</th>", text_class(column), sort,
                        column.markup.empty() ? markup_text(column.title) : column.markup);
  }
  return "<tr>" + line + "</tr>\n";
}

std::string content_of(const Cell& cell) {
  if (!cell.markup.empty()) return cell.markup;
  const std::string text = markup_text(cell.in_document());
  const std::string_view tone = class_of(cell.tone);
  return tone.empty() ? text : fmt::format("<strong class=\"{}\">{}</strong>", tone, text);
}

std::string row_line(const Table& table, const Row& row) {
  std::string line = "<tr>";
  for (std::size_t i = 0; i < row.size(); ++i) {
    const std::string value =
        row[i].value ? fmt::format(" data-value=\"{}\"", *row[i].value) : std::string();
    line += fmt::format(fmt::runtime(i == 0 ? "<th scope=\"row\"{}{}>{}</th>" : "<td{}{}>{}</td>"),
                        text_class(table.columns[i]), value, content_of(row[i]));
  }
  return line + "</tr>\n";
}

/// The region, the table and its name.
std::string opening_of(const Table& table) {
  if (table.id.empty()) {
    return fmt::format(
        "<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"{}\">"
        "<table class=\"list\">\n",
        markup_text(table.caption));
  }
  return fmt::format(
      "<div class=\"scroll\" role=\"region\" aria-labelledby=\"{0}-caption\" tabindex=\"0\">\n"
      "<table id=\"{0}\">\n<caption id=\"{0}-caption\">{1}</caption>\n",
      table.id, markup_text(table.caption));
}

std::string paragraph(std::string_view text) {
  return text.empty() ? "" : fmt::format("<p class=\"note\">{}</p>\n", sentence_markup(text));
}

}  // namespace

std::string sentence_markup(std::string_view text) {
  std::string markup;
  for (;;) {
    const std::size_t begin = std::min(text.find('`'), text.size());
    const std::size_t end = text.find('`', begin + 1);
    if (end == std::string_view::npos) return markup + markup_text(text);
    markup += fmt::format("{}<code>{}</code>", markup_text(text.substr(0, begin)),
                          markup_text(text.substr(begin + 1, end - begin - 1)));
    text.remove_prefix(end + 1);
  }
}

std::string html_table(const Table& table) {
  std::string html = opening_of(table) + "<thead>\n" + group_line(table) + title_line(table) +
                     "</thead>\n<tbody>\n";
  for (const Row& row : table.rows) html += row_line(table, row);
  html += "</tbody>\n</table>\n</div>\n";
  for (const Remark& remark : table.remarks) html += paragraph(remark.text);
  for (const std::string& note : table.notes) html += paragraph(note);
  return html;
}

std::string table_or_nothing(const Table& table) {
  return table.rows.empty() ? "" : html_table(table);
}

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

std::string given_figure(double value) { return fmt::format("{:.6g}", value); }

std::string without_end_zeros(std::string figure) {
  if (figure.find('.') == std::string::npos) return figure;
  figure.erase(figure.find_last_not_of('0') + 1);
  if (figure.back() == '.') figure.pop_back();
  return figure;
}

std::string grouped(std::uint64_t count) {
  std::string digits = std::to_string(count);
  for (std::size_t place = digits.size(); place > 3; place -= 3) digits.insert(place - 3, 1, ',');
  return digits;
}

std::string counted(std::uint64_t count, std::string_view thing) {
  return fmt::format("{} {}{}", count, thing, count == 1 ? "" : "s");
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
