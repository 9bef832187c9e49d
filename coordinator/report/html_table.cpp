#include "coordinator/report/html_table.hpp"

#include <fmt/format.h>

#include <string_view>
#include <utility>

#include "coordinator/charts/theme.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

using wire::markup_text;

std::string_view text_class(bool is_text) { return is_text ? " class=\"words\"" : ""; }

std::string group_line(const HtmlTable& table) {
  std::string line;
  bool has_groups = false;
  for (std::size_t i = 0; i < table.columns.size();) {
    std::size_t end = i + 1;
    const std::string& group = table.columns[i].group;
    while (!group.empty() && end < table.columns.size() && table.columns[end].group == group) ++end;
    has_groups |= !group.empty();
    line += group.empty() ? "<td></td>"
                          : fmt::format("<th scope=\"colgroup\" colspan=\"{}\">{}</th>", end - i,
                                        markup_text(group));
    i = end;
  }
  return has_groups ? "<tr>" + line + "</tr>\n" : "";
}

std::string title_line(const HtmlTable& table) {
  std::string line;
  for (const HtmlColumn& column : table.columns) {
    const std::string sort =
        column.sort.empty() ? "" : fmt::format(" aria-sort=\"{}\"", column.sort);
    line += fmt::format("<th scope=\"col\"{}{}>{}</th>", text_class(column.is_text), sort,
                        column.title);
  }
  return "<tr>" + line + "</tr>\n";
}

std::string row_line(const HtmlTable& table, const HtmlRow& row) {
  std::string line = "<tr>";
  for (std::size_t i = 0; i < row.size(); ++i) {
    const HtmlCell& cell = row[i];
    const std::string_view text = text_class(cell.is_text || table.columns[i].is_text);
    const std::string value =
        cell.value ? fmt::format(" data-value=\"{}\"", *cell.value) : std::string();
    line += i == 0 ? fmt::format("<th scope=\"row\"{}{}>{}</th>", text, value, cell.markup)
                   : fmt::format("<td{}{}>{}</td>", text, value, cell.markup);
  }
  return line + "</tr>\n";
}

/// The region, the table and its name.
std::string opening_of(const HtmlTable& table) {
  if (table.id.empty()) {
    return fmt::format(
        "<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"{}\">"
        "<table class=\"list\">\n",
        markup_text(table.name));
  }
  return fmt::format(
      "<div class=\"scroll\" role=\"region\" aria-labelledby=\"{0}-caption\" tabindex=\"0\">\n"
      "<table id=\"{0}\">\n<caption id=\"{0}-caption\">{1}</caption>\n",
      table.id, markup_text(table.name));
}

HtmlCell cell_of(const ReviewCell& cell, bool is_first) {
  const std::string text = markup_text(cell.text);
  HtmlCell html(text);
  html.is_text = is_first || cell.kind != ReviewCell::Kind::figure;
  html.value = cell.value;
  if (cell.kind == ReviewCell::Kind::verdict) {
    const std::string_view kind = cell.text == "met"       ? "met"
                                  : cell.text == "not met" ? "unmet"
                                                           : "open";
    html.markup = fmt::format("<strong class=\"{}\">{}</strong>", kind, text);
  }
  return html;
}

}  // namespace

std::string html_table(const HtmlTable& table) {
  std::string html = opening_of(table) + "<thead>\n" + group_line(table) + title_line(table) +
                     "</thead>\n<tbody>\n";
  for (const HtmlRow& row : table.rows) html += row_line(table, row);
  return html + "</tbody>\n</table>\n</div>\n";
}

std::string html_table(const ReviewTable& table) {
  HtmlTable shown{.name = table.caption, .id = table.id, .columns = {}, .rows = {}};
  for (const ReviewColumn& column : table.columns) {
    shown.columns.push_back(
        {.title = markup_text(column.title), .is_text = column.is_text, .group = column.group});
  }
  for (const std::vector<ReviewCell>& row : table.rows) {
    HtmlRow& cells = shown.rows.emplace_back();
    for (const ReviewCell& cell : row) cells.push_back(cell_of(cell, cells.empty()));
  }
  std::string html = html_table(shown);
  for (const std::string& note : table.notes) {
    if (!note.empty()) html += fmt::format("<p class=\"note\">{}</p>\n", markup_text(note));
  }
  return html;
}

std::string review_style() {
  // Verdicts: the inks of the charts are for lines; text needs 4.5:1.
  constexpr std::string_view light =
      "--met:#00603f;--unmet:#a83c00;--open:#6b4a00;--heading:#f2f4f6;";
  constexpr std::string_view dark =
      "--met:#45c79b;--unmet:#ff9d5c;--open:#e6b84d;--heading:#1f242b;";
  return fmt::format(
             ":root{{color-scheme:light dark;{}{}}}\n"
             "@media (prefers-color-scheme:dark){{:root{{{}{}}}}}\n"
             "@media print{{:root{{{}{}}}}}\n",
             light_colours(), light, dark_colours(), dark, light_colours(), light) +
         R"(.scroll{overflow-x:auto;max-width:100%;margin:.5rem 0}
.scroll:focus-visible,a:focus-visible{outline:3px solid var(--chart-first);outline-offset:2px}
table{border-collapse:collapse;font-size:.9rem;font-variant-numeric:tabular-nums}
caption{text-align:left;font-weight:600;padding:.3rem 0;white-space:nowrap}
th,td{padding:.25rem .6rem;text-align:right;vertical-align:top}
th,td{border-bottom:1px solid var(--chart-grid)}
thead th{vertical-align:bottom}
thead th,thead td{background:var(--heading)}
th[scope=colgroup]{text-align:center}
th.words,td.words{text-align:left}
td{white-space:nowrap}
td.words{white-space:normal}
tbody th{font-weight:600;position:sticky;left:0;background:var(--chart-ground)}
.met{color:var(--met)}.unmet{color:var(--unmet)}.open{color:var(--open)}
td strong{white-space:nowrap}
.note{font-size:.9rem;margin:.3rem 0;max-width:48rem}
code{font-family:ui-monospace,monospace;font-size:.9em}
figure{margin:.5rem 0;max-width:100%}
figure svg{display:block;height:auto;max-width:100%}
.scroll figure,.scroll svg{max-width:none}
.flow{display:flex;flex-wrap:wrap;align-items:flex-start;gap:.5rem 1rem}
.flow>div{max-width:100%}
)";
}

}  // namespace proofmass::coordinator
