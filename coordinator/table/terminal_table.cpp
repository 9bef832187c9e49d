#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdint>
#include <sstream>
#include <utility>
#include <vector>

#include "coordinator/table/table.hpp"

namespace proofmass::coordinator {
namespace {

constexpr std::size_t columns_max = 80;  // Of what is broken to lines.
constexpr std::size_t gap = 2;           // Before a column that is as wide as its cells.
constexpr std::size_t text_width_min = 8;

std::size_t longest_word(const std::string& text) {
  std::istringstream words(text);
  std::size_t longest = 0;
  for (std::string word; words >> word;) longest = std::max(longest, display_width(word));
  return longest;
}

/// lines_of(), whatever the words are but those of commands, between backticks, which people copy.
std::vector<std::string> broken(const std::string& text, std::size_t first, std::size_t width) {
  std::vector<std::string> lines = lines_of(text, first, width);
  bool is_in_command = false;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const std::size_t room = std::max(i == 0 ? first : width, text_width_min);
    const auto num_marks = std::ranges::count(lines[i], '`');
    const bool is_of_command = is_in_command || num_marks > 0;
    is_in_command = is_in_command != (num_marks % 2 == 1);
    if (is_of_command || display_width(lines[i]) <= room) continue;
    const std::size_t size = shortened(lines[i], room).size() - std::string_view("…").size();
    lines.insert(lines.begin() + static_cast<std::ptrdiff_t>(i) + 1, lines[i].substr(size));
    lines[i].resize(size);
  }
  return lines;
}

std::string without_end_blanks(std::string line) {
  line.erase(line.find_last_not_of(' ') + 1);
  return line;
}

/// Writes one table. Columns that are for documents alone are left out from the beginning.
class TerminalTable {
 public:
  TerminalTable(const Table& table, const TerminalStyle& style) : table_(table), style_(style) {
    for (std::size_t i = 0; i < table.columns.size(); ++i) {
      const Column& column = table.columns[i];
      if (column.is_for_documents) continue;
      ShownColumn shown{.column = &column, .index = i};
      if (!shown.has_own_width() && !columns_.empty()) shown.lead = gap;
      const std::size_t blanks = shown.has_own_width() ? 1 : shown.lead;
      shown.width = column.width;
      const auto make_room = [&](const std::string& text, std::size_t before) {
        const std::string visible = wire::visible_text(text);
        const std::size_t width = display_width(visible);
        shown.width = std::max(shown.width, width + before);
        shown.needed =
            std::max(shown.needed, (column.is_text ? longest_word(visible) : width) + before);
      };
      const bool is_beside_number =
          !columns_.empty() && !columns_.back().column->is_text && !column.is_after_line;
      make_room(column.title, column.is_text || is_beside_number ? blanks : shown.lead);
      for (const Row& row : table.rows) make_room(row[i].text, blanks);
      columns_.push_back(shown);
    }
    widen_for_groups();
    fit();
  }

  [[nodiscard]] std::string text() const {
    std::string text;
    if (!table_.caption.empty()) text += wire::visible_text(table_.caption) + "\n\n";
    if (are_rows_records_) {
      text += records();
    } else if (!columns_.empty()) {
      text += heading();
      for (const Row& cells : table_.rows) {
        if (table_.has_total && &cells == &table_.rows.back()) text += rule();
        text += row(cells);
      }
    }
    for (const Remark& remark : table_.remarks) {
      std::string visible = wire::visible_text(remark.text);
      if (style_.cuts_remarks) visible = shortened(visible, style_.line_width_max);
      if (display_width(visible) > style_.line_width_max) visible = wrapped(visible, 2, 0);
      text += in_tone(visible, remark.tone, style_.paint) + "\n";
    }
    for (const std::string& note : table_.notes)
      text += wrapped(wire::visible_text(note), 2, 0) + "\n";
    return text;
  }

 private:
  /// What a table that is too wide does without, in turn: blanks before numbers; lines of several
  /// words; whole words.
  enum class Cut : std::uint8_t { blanks, lines, words };

  struct ShownColumn {
    const Column* column;
    std::size_t index;      ///< Among all columns of the table.
    std::size_t lead = 0;   ///< Blanks before it.
    std::size_t width = 0;  ///< With the blanks.
    std::size_t needed =
        0;  ///< Of that, for its title and its cells; for the longest word of text.

    [[nodiscard]] bool has_own_width() const { return column->width > 0; }
    /// For text; a column of numbers is as wide as they are.
    [[nodiscard]] std::size_t room() const {
      if (!column->is_text) return width - lead;
      return width - (has_own_width() ? 1 : lead);
    }
    [[nodiscard]] std::size_t width_min(Cut cut) const {
      if (column->is_text && cut == Cut::blanks) return width;
      if (!column->is_text || cut == Cut::lines) return needed;
      return has_own_width() ? std::min(column->width, text_width_min + 1) : text_width_min + lead;
    }
  };

  /// The last column of a group has the room that the columns before it lack for its heading.
  void widen_for_groups() {
    for (std::size_t i = 0; i < columns_.size(); ++i) {
      const std::size_t heading = display_width(columns_[i].column->group);
      std::size_t width = columns_[i].width, needed = columns_[i].needed;
      while (continues_group(i + 1)) {
        width += columns_[++i].width;
        needed += columns_[i].needed;
      }
      columns_[i].width += heading - std::min(heading, width);
      columns_[i].needed += heading - std::min(heading, needed);
    }
  }

  /// Whether a heading of the column before it goes on above it.
  [[nodiscard]] bool continues_group(std::size_t i) const {
    return i < columns_.size() && !columns_[i].column->is_after_line &&
           columns_[i].column->group == columns_[i - 1].column->group;
  }

  // Takes from the widest column, one at a time.
  void fit() {
    std::size_t total = 0;
    bool have_own_widths = false;
    for (const ShownColumn& shown : columns_) {
      total += shown.width + (shown.column->is_after_line ? 1 : 0);
      have_own_widths = have_own_widths || shown.has_own_width();
    }
    // Rows that are written one at a time stay below one another: their numbers keep their places.
    for (const Cut cut : {Cut::blanks, Cut::lines, Cut::words}) {
      if (!style_.wraps_cells && cut != Cut::words) continue;
      const auto to_spare = [&](const ShownColumn& shown) {
        return shown.width > shown.width_min(cut) ? shown.width : 0;
      };
      while (total > style_.line_width_max) {
        ShownColumn& widest = *std::ranges::max_element(columns_, {}, to_spare);
        if (to_spare(widest) == 0) break;
        --widest.width;
        --total;
      }
    }
    are_rows_records_ = total > style_.line_width_max && !have_own_widths && !table_.rows.empty();
  }

  [[nodiscard]] bool is_before_line(std::size_t i) const {
    return i + 1 < columns_.size() && columns_[i + 1].column->is_after_line;
  }

  [[nodiscard]] std::vector<std::string> lines_in(const ShownColumn& shown,
                                                  const Cell& cell) const {
    const std::string text = wire::visible_text(cell.text);
    const bool is_wrapped =
        style_.wraps_cells && shown.column->is_text && display_width(text) > shown.room();
    return is_wrapped ? broken(text, shown.room(), shown.room())
                      : std::vector{shortened(text, shown.room())};
  }

  /// One line of what a cell shows.
  [[nodiscard]] std::string cell(std::size_t i, const std::string& text, const Cell& cell) const {
    const ShownColumn& shown = columns_[i];
    const std::size_t taken = shown.lead + display_width(text);
    std::string blanks(shown.width > taken ? shown.width - taken : 0, ' ');
    std::string line = shown.column->is_after_line ? "│" : "";
    line.append(shown.lead, ' ');
    const std::string painted = in_tone(text, cell.tone, style_.paint);
    if (shown.column->is_text && !cell.value) return line + painted + blanks;
    // One blank moves behind the number, unless it is what separates that from the column before
    // it.
    const std::size_t kept = shown.has_own_width() ? 1 : 0;
    if (!is_before_line(i) || blanks.size() <= kept) return line + blanks + painted;
    blanks.pop_back();
    return line + blanks + painted + " ";
  }

  [[nodiscard]] std::string row(const Row& cells) const {
    std::vector<std::vector<std::string>> shown;
    std::size_t height = 0;
    for (const ShownColumn& column : columns_) {
      shown.push_back(lines_in(column, cells[column.index]));
      height = std::max(height, shown.back().size());
    }
    std::string text;
    for (std::size_t k = 0; k < height; ++k) {
      std::string line;
      for (std::size_t i = 0; i < columns_.size(); ++i) {
        line += cell(i, k < shown[i].size() ? shown[i][k] : "", cells[columns_[i].index]);
      }
      text += without_end_blanks(std::move(line)) + "\n";
    }
    return text;
  }

  /// Each group in the middle of its columns; empty if no column has one.
  [[nodiscard]] std::string groups() const {
    std::string line;
    bool has_group = false;
    for (std::size_t i = 0; i < columns_.size();) {
      const std::string& group = columns_[i].column->group;
      if (columns_[i].column->is_after_line) line += "│";
      std::size_t width = columns_[i].width;
      while (continues_group(++i)) width += columns_[i].width;
      const std::size_t taken = display_width(group);
      line +=
          left_aligned(std::string(width > taken ? (width - taken) / 2 : 0, ' ') + group, width);
      has_group = has_group || !group.empty();
    }
    return has_group ? without_end_blanks(std::move(line)) + "\n" : "";
  }

  /// The horizontal line below the titles, up to the last one; the vertical lines cross it.
  [[nodiscard]] std::string rule() const {
    std::size_t count = columns_.size();
    while (count > 0 && columns_[count - 1].column->title.empty()) --count;
    std::string rule;
    for (std::size_t i = 0; i < count; ++i) {
      if (columns_[i].column->is_after_line) rule += "┼";
      rule.append(columns_[i].lead, ' ');
      for (std::size_t k = columns_[i].lead; k < columns_[i].width; ++k) rule += "─";
    }
    return rule + "\n";
  }

  [[nodiscard]] std::string heading() const {
    Row cells;
    for (const Column& column : table_.columns) cells.emplace_back(column.title);
    std::string titles = row(cells);
    titles.pop_back();  // The end of the line is not painted.
    return groups() + in_tone(titles, Tone::heading, style_.paint) + "\n" + rule();
  }

  [[nodiscard]] std::string records() const {
    std::size_t name_width = 0;
    for (const ShownColumn& shown : columns_) {
      name_width = std::max(name_width, display_width(shown.column->title));
    }
    std::string text;
    for (std::size_t row = 0; row < table_.rows.size(); ++row) {
      text += fmt::format("row {}\n", row + 1);
      for (const ShownColumn& shown : columns_) {
        const Cell& cell = table_.rows[row][shown.index];
        const std::string line = without_end_blanks(
            fmt::format("  {}  {}", left_aligned(shown.column->title, name_width), cell.text));
        text += (cell.value ? line : shortened(line, style_.line_width_max)) + "\n";
      }
    }
    return text;
  }

  const Table& table_;
  TerminalStyle style_;
  std::vector<ShownColumn> columns_;
  bool are_rows_records_ = false;  ///< No row fits in a line.
};

}  // namespace

int colour_of(Tone tone) {
  if (tone == Tone::good) return 31;                         // #0087af.
  return tone == Tone::open || tone == Tone::bad ? 130 : 0;  // #af5f00.
}

std::string in_tone(std::string_view text, Tone tone, Paint paint) {
  if (paint == Paint::no || tone == Tone::plain || text.empty()) return std::string(text);
  const int colour = colour_of(tone);
  if (colour == 0) return fmt::format("\033[1m{}\033[0m", text);
  return fmt::format("\033[1;38;5;{}m{}\033[0m", colour, text);
}

TerminalStyle document_style(Paint paint) {
  return {.line_width_max = columns_max, .paint = paint, .wraps_cells = true};
}

std::string terminal_text(const Table& table, const TerminalStyle& style) {
  return TerminalTable(table, style).text();
}

std::string left_aligned(std::string_view text, std::size_t width) {
  const std::size_t taken = display_width(text);
  return std::string(text) + std::string(width > taken ? width - taken : 0, ' ');
}

std::vector<std::string> lines_of(const std::string& text, std::size_t first, std::size_t width) {
  std::istringstream words(text);
  std::vector<std::string> lines{""};
  for (std::string word; words >> word;) {
    std::string longer = lines.back().empty() ? word : fmt::format("{} {}", lines.back(), word);
    const bool fits = display_width(longer) <= (lines.size() == 1 ? first : width);
    if (fits || lines.back().empty()) {
      lines.back() = std::move(longer);
    } else {
      lines.push_back(std::move(word));
    }
  }
  return lines;
}

std::string wrapped(const std::string& text, std::size_t indent, std::size_t begin) {
  const std::vector<std::string> lines = broken(text, columns_max - begin, columns_max - indent);
  return fmt::format("{}", fmt::join(lines, fmt::format("\n{:{}}", "", indent)));
}

std::string fitted(std::string_view text) {
  constexpr std::size_t label_width_max = 16;
  std::istringstream stream{std::string(text)};
  std::string lines;
  for (std::string line; std::getline(stream, line); lines += line + "\n") {
    if (display_width(line) <= columns_max) continue;
    const std::size_t gap = std::min(line.find("  "), line.size());
    const bool has_label = gap > 0 && gap < label_width_max;
    const std::size_t begin =
        std::min(line.find_first_not_of(' ', has_label ? gap : 0), line.size());
    line.replace(begin, line.size(),
                 wrapped(line.substr(begin), begin + (has_label ? 0 : 2), begin));
  }
  return lines;
}

}  // namespace proofmass::coordinator
