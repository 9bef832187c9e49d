#pragma once

#include <string>

#include "coordinator/table/table.hpp"

namespace proofmass::coordinator {

/// The table as markup, in a region that scrolls by itself where the window is narrow, and its
/// lines and notes as paragraphs. With an id the caption is shown; without, only screen readers
/// tell it.
[[nodiscard]] std::string html_table(const Table& table);

/// A table as html_table() writes it; empty if it has no rows.
[[nodiscard]] std::string table_or_nothing(const Table& table);

}  // namespace proofmass::coordinator
