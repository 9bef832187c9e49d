#include "coordinator/table/html_table.hpp"

#include <fmt/format.h>

#include <string_view>

#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

using wire::markup_text;

std::string_view text_class(const Column& column) {
  return column.is_text ? " class=\"words\"" : "";
}

std::string_view class_of(Tone tone) {
  switch (tone) {
    case Tone::good:
      return "met";
    case Tone::bad:
      return "unmet";
    case Tone::open:
      return "open";
    default:
      return "";
  }
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
  return text.empty() ? "" : fmt::format("<p class=\"note\">{}</p>\n", markup_text(text));
}

}  // namespace

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

}  // namespace proofmass::coordinator
