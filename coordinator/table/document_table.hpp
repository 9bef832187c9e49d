#pragma once

#include <span>
#include <string>
#include <string_view>

#include "coordinator/table/table.hpp"

namespace proofmass::coordinator {

/// The table as markup, in a region that scrolls by itself where the window is narrow, and its
/// lines and notes as paragraphs. With an id the caption is shown; without, only screen readers
/// tell it.
[[nodiscard]] std::string html_table(const Table& table);

/// Sentences as markup; what stands between backticks is code.
[[nodiscard]] std::string sentence_markup(std::string_view text);

/// A table as html_table() writes it; empty if it has no rows.
[[nodiscard]] std::string table_or_nothing(const Table& table);

/// Text in which Markdown finds nothing of its own: what could begin markup has a backslash before
/// it. An underscore inside a word begins none.
[[nodiscard]] std::string markdown_text(std::string_view text);

/// The lines that a table of GitHub's Markdown begins with, and one of its rows.
[[nodiscard]] std::string markdown_heading(std::span<const Column> columns);
[[nodiscard]] std::string markdown_row(std::span<const Cell> cells);

/// The caption, the table, its lines and notes, and an empty line.
[[nodiscard]] std::string markdown_table(const Table& table);

}  // namespace proofmass::coordinator
