#include <fmt/format.h>

#include <string_view>

#include "coordinator/charts/theme.hpp"
#include "coordinator/report/review_html.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

using wire::markup_text;

std::string group_row(const ReviewTable& table) {
  std::string row;
  bool has_groups = false;
  for (std::size_t i = 0; i < table.columns.size();) {
    std::size_t end = i + 1;
    const std::string& group = table.columns[i].group;
    while (!group.empty() && end < table.columns.size() && table.columns[end].group == group) ++end;
    has_groups |= !group.empty();
    row += group.empty() ? "<td></td>"
                         : fmt::format("<th scope=\"colgroup\" colspan=\"{}\">{}</th>", end - i,
                                       markup_text(group));
    i = end;
  }
  return has_groups ? "<tr>" + row + "</tr>\n" : "";
}

std::string title_row(const ReviewTable& table) {
  std::string row;
  for (const ReviewColumn& column : table.columns) {
    row += fmt::format("<th scope=\"col\"{}>{}</th>", column.is_text ? " class=\"words\"" : "",
                       markup_text(column.title));
  }
  return "<tr>" + row + "</tr>\n";
}

std::string value_attribute(const ReviewCell& cell) {
  return cell.value ? fmt::format(" data-value=\"{}\"", *cell.value) : "";
}

std::string cell_markup(const ReviewCell& cell, bool is_first) {
  const std::string text = markup_text(cell.text);
  if (is_first) return fmt::format("<th scope=\"row\" class=\"words\">{}</th>", text);
  switch (cell.kind) {
    case ReviewCell::Kind::figure:
      return fmt::format("<td{}>{}</td>", value_attribute(cell), text);
    case ReviewCell::Kind::words:
      return fmt::format("<td class=\"words\"{}>{}</td>", value_attribute(cell), text);
    case ReviewCell::Kind::command:
      return fmt::format("<td class=\"words\"{}><code>{}</code></td>", value_attribute(cell), text);
    case ReviewCell::Kind::verdict:
      return fmt::format("<td class=\"words\"><strong class=\"{}\">{}</strong></td>",
                         cell.text == "met"       ? "met"
                         : cell.text == "not met" ? "unmet"
                                                  : "open",
                         text);
  }
  return "";
}

}  // namespace

std::string html_table(const ReviewTable& table) {
  std::string html = fmt::format(
      "<div class=\"scroll\" role=\"region\" aria-labelledby=\"{0}-caption\" tabindex=\"0\">\n"
      "<table id=\"{0}\">\n<caption id=\"{0}-caption\">{1}</caption>\n<thead>\n{2}{3}</thead>\n"
      "<tbody>\n",
      table.id, markup_text(table.caption), group_row(table), title_row(table));
  for (const std::vector<ReviewCell>& row : table.rows) {
    html += "<tr>";
    for (std::size_t i = 0; i < row.size(); ++i) html += cell_markup(row[i], i == 0);
    html += "</tr>\n";
  }
  html += "</tbody>\n</table>\n</div>\n";
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
.note{font-size:.9rem;margin:.3rem 0;max-width:48rem}
code{font-family:ui-monospace,monospace;font-size:.9em}
figure{margin:.5rem 0;min-width:0}
figure svg{display:block;height:auto}
.charts{display:grid;grid-template-columns:repeat(auto-fill,minmax(min(22rem,100%),1fr));gap:1rem}
.wide svg{min-width:40rem;max-width:64rem}
.overview svg{max-width:44rem}
.single svg{max-width:36rem}
)";
}

}  // namespace proofmass::coordinator
