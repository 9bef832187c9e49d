#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {

/// What a part of a table is painted for. Colour never says anything that the words do not: it only
/// helps to find them.
enum class Tone : std::uint8_t {
  plain,
  heading,  ///< Titles of a table.
  good,     ///< A requirement that is met, a check that passes.
  open,     ///< What is not decided yet.
  bad,      ///< What somebody should look at: an error beyond its objective, a failure, a loss.
  changed,  ///< A significant change, good or bad.
};

/// A cell. Its text may hold anything: each writer makes it safe for its output.
struct Cell {
  std::string text;
  std::optional<double> value = {};  ///< In full precision and SI units, for programs.
  Tone tone = Tone::plain;
  /// What documents (HTML, Markdown) show instead, as they have superscripts; empty: the text.
  std::string document = {};
  std::string markup = {};  ///< What HTML shows instead, as it is; empty: the text.

  template <std::convertible_to<std::string_view> Text>
  Cell(const Text& shown, Tone painted = Tone::plain)
      : text(std::string_view(shown)), tone(painted) {}
  template <std::convertible_to<std::string_view> Text>
  Cell(const Text& shown, double number) : text(std::string_view(shown)), value(number) {}

  [[nodiscard]] const std::string& in_document() const {
    return document.empty() ? text : document;
  }
};

/// A column: text stands left, numbers right.
struct Column {
  std::string title;
  bool is_text = false;
  /// Columns of a terminal that it usually takes, with at least one blank beside the next column;
  /// 0: as many as its cells need, and two blanks.
  std::size_t width = 0;
  /// Heading above this column and the next ones with the same one, up to a vertical line.
  std::string group = {};
  bool is_after_line = false;     ///< A vertical line separates it from the column before it.
  bool is_for_documents = false;  ///< A terminal has no room for it.
  std::string sort = {};    ///< `ascending` or `descending` if the rows are in this column's order.
  std::string markup = {};  ///< The title as HTML shows it; empty: the title.
};

/// A line below a table about one thing in it.
struct Remark {
  std::string text;
  Tone tone = Tone::plain;
};

using Row = std::vector<Cell>;

/// A table, and what is said below it. The first cell of a row is its heading.
struct Table {
  std::string id = {};  ///< Unique in a document, of a-z, 0-9 and -; may be empty.
  std::string caption = {};
  std::vector<Column> columns = {};
  std::vector<Row> rows = {};
  bool has_total = false;               ///< The last row sums up the others.
  std::vector<Remark> remarks = {};     ///< Below the rows.
  std::vector<std::string> notes = {};  ///< Sentences about the table, below that.
};

/// A number ≥ 0 with three significant digits: `0.361`, `7.53`, `49.2`, `1240`; from a million on
/// and below a thousandth `1.2e+06`, which is at most seven characters below 1e99.
[[nodiscard]] std::string measured_figure(double value);

/// Any number in the spelling of measured_figure(), with a minus sign if it is below 0.
[[nodiscard]] std::string signed_figure(double value);

/// A number ≥ 0 that somebody gave, with up to six digits: `7.3`, `2000`, `196.74`.
[[nodiscard]] std::string given_figure(double value);

/// A decimal fraction without zeros at its end, and without a point that would be last.
[[nodiscard]] std::string without_end_zeros(std::string figure);

/// `1,234,567`
[[nodiscard]] std::string grouped(std::uint64_t count);

/// `1 run`, `2 runs`.
[[nodiscard]] std::string counted(std::uint64_t count, std::string_view thing);

/// For people: `42 s`, `3 min 20 s`, `5 h 10 min`, `12 d 4 h`.
[[nodiscard]] std::string duration_text(double seconds);

using wire::display_width;
using wire::shortened;

enum class Paint : std::uint8_t { no, yes };

/// What a terminal, or a file in its place, takes.
struct TerminalStyle {
  std::size_t line_width_max = std::numeric_limits<std::size_t>::max();
  Paint paint = Paint::no;
  bool cuts_remarks = false;  ///< Remarks are cut to the line, else they take what they need.
  bool wraps_cells = false;   ///< Text that a column has no room for goes on below, else it is cut.
};

/// Of a text that nobody cuts: lines of at most 80 columns, on a terminal or not.
[[nodiscard]] TerminalStyle document_style(Paint paint);

/// Number of a tone's colour among the 256 of a terminal, or 0 for the terminal's own. Blue and
/// orange can be told apart by colour-blind people, and have a contrast of at least 4:1 on black
/// and on white.
[[nodiscard]] int colour_of(Tone tone);

/// Visible text between the control sequences of its tone; as it is if nothing is painted.
[[nodiscard]] std::string in_tone(std::string_view text, Tone tone, Paint paint);

/// The caption, the rows below their titles, the remarks and the notes; notes are broken to lines
/// of 80 columns. Whatever the texts hold, they are visible.
[[nodiscard]] std::string terminal_text(const Table& table, const TerminalStyle& style = {});

/// Text filled up with spaces on the right to `width` columns of a terminal.
[[nodiscard]] std::string left_aligned(std::string_view text, std::size_t width);

/// Words in lines of at most `first` columns, and then of `width`; a longer word has its own.
[[nodiscard]] std::vector<std::string> lines_of(const std::string& text, std::size_t first,
                                                std::size_t width);

/// Text broken between words, and in longer ones, to lines of at most 80 columns, from the second
/// one on after `indent` spaces; the first one begins at column `begin`. No end of the last line.
/// A longer word of a command, which stands between backticks, has a line that is wider.
[[nodiscard]] std::string wrapped(const std::string& text, std::size_t indent, std::size_t begin);

/// Lines, those of more than 80 columns broken as by wrapped(). What follows of such a line stands
/// below what it has behind its label, as in `Note      text`, else two columns further right.
[[nodiscard]] std::string fitted(std::string_view text);

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
