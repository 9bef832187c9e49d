#pragma once

#include <optional>
#include <string>
#include <vector>

#include "coordinator/report/review_tables.hpp"

namespace proofmass::coordinator {

/// A column of a table. Text stands left, numbers right.
struct HtmlColumn {
  std::string title = {};  ///< Markup.
  bool is_text = false;
  std::string sort = {};  ///< `ascending` or `descending` if the rows are in this column's order.
  std::string group =
      {};  ///< Plain heading above this column and its neighbours with the same one.
};

struct HtmlCell {
  std::string markup;
  bool is_text = false;              ///< Also in a column of numbers.
  std::optional<double> value = {};  ///< In full precision, for programs that read the page.

  // Most cells are markup and nothing else.
  HtmlCell(std::string cell_markup) : markup(std::move(cell_markup)) {}
};

using HtmlRow = std::vector<HtmlCell>;

/// A table as markup: a region that scrolls by itself where the window is narrow. The first cell of
/// a row is its heading.
struct HtmlTable {
  std::string name;  ///< Plain text.
  std::string id =
      {};  ///< If there is one, the name is seen as a caption; else screen readers know.
  std::vector<HtmlColumn> columns;
  std::vector<HtmlRow> rows;
};

[[nodiscard]] std::string html_table(const HtmlTable& table);

/// A table of a report with its caption and notes.
[[nodiscard]] std::string html_table(const ReviewTable& table);

/// The style that html_table() and embedded charts need: rules of CSS without their element.
/// Colours are custom properties, for light and dark.
[[nodiscard]] std::string review_style();

}  // namespace proofmass::coordinator
