#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "coordinator/report/review_tables.hpp"

namespace proofmass::coordinator {

/// A column of a table. Text stands left, numbers right.
struct HtmlColumn {
  std::string title = {};  ///< Markup.
  bool is_text = false;
  std::string sort = {};  ///< `ascending` or `descending` if the rows are in this column's order.
  /// Plain text above this column and those beside it that have the same.
  std::string group = {};
};

/// A cell, made from its markup; most need nothing else.
struct HtmlCell {
  std::string markup;
  bool is_text = false;              ///< Stands left although its column holds numbers.
  std::optional<double> value = {};  ///< In full precision, for programs that read the page.

  HtmlCell(std::string cell_markup) : markup(std::move(cell_markup)) {}
};

/// The first cell is the heading of the row.
using HtmlRow = std::vector<HtmlCell>;

struct HtmlTable {
  std::string name;  ///< Plain text.
  /// With an id the name is shown as a caption; without, only screen readers tell it.
  std::string id = {};
  std::vector<HtmlColumn> columns;
  std::vector<HtmlRow> rows;
};

/// The table as markup, in a region that scrolls by itself where the window is narrow.
[[nodiscard]] std::string html_table(const HtmlTable& table);

/// A table of a report with its caption and notes.
[[nodiscard]] std::string html_table(const ReviewTable& table);

/// The style that html_table() and embedded charts need: rules of CSS without their element.
/// Colours are custom properties, for light and dark.
[[nodiscard]] std::string review_style();

}  // namespace proofmass::coordinator
