#include "coordinator/query/row_writer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>
#include <vector>

#include "coordinator/report/text_cells.hpp"
#include "core/error.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

/// One text for each type of a cell.
struct TextOf {
  std::string operator()(std::monostate) const { return {}; }
  std::string operator()(std::int64_t value) const { return std::to_string(value); }
  std::string operator()(double value) const { return shortest_text(value); }
  std::string operator()(std::string_view text) const { return std::string(text); }
  std::string operator()(const Blob& blob) const { return blob_text(blob); }
};

}  // namespace

std::string shortest_text(double value) {
  std::array<char, 32> text{};
  const auto [end, error] = std::to_chars(text.data(), text.data() + text.size(), value);
  PROOFMASS_EXPECT(error == std::errc());
  return {text.data(), end};
}

std::string blob_text(const Blob& blob) {
  static constexpr std::string_view digits = "0123456789abcdef";
  std::string text = "x'";
  for (const char c : blob.bytes) {
    const auto byte = static_cast<unsigned char>(c);
    text += digits[byte >> 4U];
    text += digits[byte & 15U];
  }
  return text + "'";
}

std::string cell_text(const Cell& cell) { return std::visit(TextOf{}, cell); }

bool is_number(const Cell& cell) {
  return std::holds_alternative<std::int64_t>(cell) || std::holds_alternative<double>(cell);
}

namespace {

// Formats for programs, which lose nothing and hold any number of rows.

std::string csv_quoted(std::string_view text) {
  std::string quoted = "\"";
  for (const char c : text) {
    quoted += c;
    if (c == '"') quoted += c;
  }
  return quoted + '"';
}

std::string csv_text(std::string_view text) {
  const bool is_plain = !text.empty() && text.find_first_of(",\"\r\n") == std::string_view::npos;
  return is_plain ? std::string(text) : csv_quoted(text);
}

std::string csv_cell(const Cell& cell) {
  const auto* text = std::get_if<std::string_view>(&cell);
  return text == nullptr ? cell_text(cell) : csv_text(*text);
}

std::string json_text(std::string_view text) {
  constexpr auto on_error = nlohmann::json::error_handler_t::replace;
  return nlohmann::json(text).dump(-1, ' ', false, on_error);
}

// A number without point or exponent would be read as an integer, and -0 lose its sign.
std::string json_number(double value) {
  if (std::isinf(value)) return value > 0.0 ? "1e999" : "-1e999";
  const std::string text = shortest_text(value);
  return text.find_first_of(".e") == std::string::npos ? text + ".0" : text;
}

std::string json_cell(const Cell& cell) {
  if (std::holds_alternative<std::monostate>(cell)) return "null";
  if (const auto* text = std::get_if<std::string_view>(&cell)) return json_text(*text);
  if (const auto* real = std::get_if<double>(&cell)) return json_number(*real);
  return is_number(cell) ? cell_text(cell) : json_text(cell_text(cell));
}

/// [RFC4180]: lines end in CR LF, the first has the names of the columns. NULL is an empty field,
/// empty text is `""`.
class CsvWriter : public RowWriter {
 public:
  explicit CsvWriter(TextSink sink) : sink_(std::move(sink)) {}
  void begin(std::span<const std::string> columns) override;
  [[nodiscard]] bool row(std::span<const Cell> cells) override;
  void end() override {}

 private:
  TextSink sink_;
};

void CsvWriter::begin(std::span<const std::string> columns) {
  std::string line;
  for (const std::string& column : columns) {
    line += fmt::format("{}{}", line.empty() ? "" : ",", csv_text(column));
  }
  sink_(line + "\r\n");
}

bool CsvWriter::row(std::span<const Cell> cells) {
  std::string line;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    line += fmt::format("{}{}", i == 0 ? "" : ",", csv_cell(cells[i]));
  }
  // Readers pass over empty lines.
  sink_((line.empty() ? "\"\"" : line) + "\r\n");
  return true;
}

/// [RFC8259]: a list with an object a row. Infinity is the number 1e999; what is not UTF-8 in a
/// text becomes U+FFFD.
class JsonWriter : public RowWriter {
 public:
  explicit JsonWriter(TextSink sink) : sink_(std::move(sink)) {}
  /// @throws InvalidArgument if two columns have the same name: readers keep one of them.
  void begin(std::span<const std::string> columns) override;
  [[nodiscard]] bool row(std::span<const Cell> cells) override;
  void end() override;

 private:
  TextSink sink_;
  std::vector<std::string> keys_;  ///< Quoted.
  bool has_rows_ = false;
};

void JsonWriter::begin(std::span<const std::string> columns) {
  std::set<std::string> names;
  for (const std::string& column : columns) {
    if (!names.insert(column).second) {
      throw InvalidArgument(fmt::format(
          "format = json (two columns are called {}; name one of them with AS)", column));
    }
    keys_.push_back(json_text(column));
  }
  sink_("[");
}

bool JsonWriter::row(std::span<const Cell> cells) {
  std::string line = has_rows_ ? ",\n {" : "\n {";
  for (std::size_t i = 0; i < cells.size(); ++i) {
    line += fmt::format("{}{}: {}", i == 0 ? "" : ", ", keys_[i], json_cell(cells[i]));
  }
  sink_(line + "}");
  has_rows_ = true;
  return true;
}

void JsonWriter::end() { sink_(has_rows_ ? "\n]\n" : "]\n"); }

// Formats for people.

constexpr std::size_t text_width_max = 100;
constexpr std::size_t text_width_min = 8;
constexpr std::string_view gap = "  ";

enum class Side : std::uint8_t { left, right };

std::string filled(std::string_view text, std::size_t width, Side side) {
  return side == Side::right ? right_aligned(text, width) : left_aligned(text, width);
}

void write_line(const TextSink& sink, std::string line) {
  line.erase(line.find_last_not_of(' ') + 1);
  sink(line + "\n");
}

bool is_part_of_word(std::string_view text, std::size_t position) {
  const auto is_word = [&](std::size_t i) {
    return i < text.size() && (std::isalnum(static_cast<unsigned char>(text[i])) != 0);
  };
  return position > 0 && is_word(position - 1) && is_word(position + 1);
}

// What Markdown would read as its own. An underscore inside a word is none.
std::string markdown_text(std::string_view text) {
  std::string escaped;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool is_special = std::string_view("\\|`*<[]").find(text[i]) != std::string_view::npos ||
                            (text[i] == '_' && !is_part_of_word(text, i));
    if (is_special) escaped += '\\';
    escaped += text[i];
  }
  return escaped;
}

// Six significant digits, for people; formats for programs have all digits.
std::string figure_text(const Cell& cell) {
  const auto* real = std::get_if<double>(&cell);
  return real == nullptr ? cell_text(cell) : fmt::format("{:.6g}", *real);
}

/// Columns side by side under their names, numbers to the right and with six significant digits.
/// Shows the first rows. Cuts text, never a number, to fit the terminal, and elsewhere to 100
/// columns; rows that do not fit even so are written as records, a line a value.
class TableWriter : public RowWriter {
 public:
  TableWriter(const TableLimits& limits, TextSink sink);
  void begin(std::span<const std::string> columns) override;
  [[nodiscard]] bool row(std::span<const Cell> cells) override;
  void end() override;

 private:
  struct Column {
    std::string name;
    bool has_text = false;
    std::size_t width = 0;
    std::vector<std::string> texts;  ///< Visible.
    std::vector<bool> is_number;
  };

  [[nodiscard]] bool fit();
  void write_records();
  void write_names();
  void write_row(std::size_t row);

  TableLimits limits_;
  TextSink sink_;
  std::vector<Column> columns_;
  std::size_t num_rows_ = 0;
  bool has_more_ = false;
};

TableWriter::TableWriter(const TableLimits& limits, TextSink sink)
    : limits_(limits), sink_(std::move(sink)) {}

void TableWriter::begin(std::span<const std::string> columns) {
  for (const std::string& name : columns) {
    const std::string shown = shortened(wire::visible_text(name), text_width_max);
    columns_.push_back(
        {.name = shown, .width = display_width(shown), .texts = {}, .is_number = {}});
  }
}

bool TableWriter::row(std::span<const Cell> cells) {
  has_more_ = num_rows_ == limits_.num_rows_max;
  if (has_more_) return false;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    Column& column = columns_[i];
    const bool is_text = !is_number(cells[i]) && !std::holds_alternative<std::monostate>(cells[i]);
    // No more than this is ever shown, and a text may have megabytes.
    const std::string text =
        wire::visible_text(std::string_view(figure_text(cells[i])).substr(0, 1000));
    column.texts.push_back(shortened(text, text_width_max));
    column.is_number.push_back(is_number(cells[i]));
    column.has_text = column.has_text || is_text;
    column.width = std::max(column.width, display_width(column.texts.back()));
  }
  ++num_rows_;
  return true;
}

// Takes from the widest column of text, one at a time. False if the lines stay too wide.
bool TableWriter::fit() {
  if (!limits_.num_columns) return true;
  std::size_t total = gap.size() * (columns_.size() - 1);
  for (const Column& column : columns_) total += column.width;
  const auto room = [](const Column& column) { return column.has_text ? column.width : 0; };
  while (total > *limits_.num_columns) {
    Column& widest = *std::ranges::max_element(columns_, {}, room);
    if (room(widest) <= text_width_min) return false;
    --widest.width;
    --total;
  }
  return true;
}

void TableWriter::write_records() {
  std::size_t name_width = 0;
  for (const Column& column : columns_) {
    name_width = std::max(name_width, display_width(column.name));
  }
  for (std::size_t row = 0; row < num_rows_; ++row) {
    write_line(sink_, fmt::format("row {}", row + 1));
    for (const Column& column : columns_) {
      const std::string line =
          fmt::format("  {}  {}", left_aligned(column.name, name_width), column.texts[row]);
      write_line(sink_, column.is_number[row] ? line : shortened(line, *limits_.num_columns));
    }
  }
}

void TableWriter::write_names() {
  std::string names;
  std::string rule;
  for (const Column& column : columns_) {
    const std::string_view space = &column == &columns_.front() ? "" : gap;
    const Side side = column.has_text ? Side::left : Side::right;
    names += fmt::format("{}{}", space,
                         filled(shortened(column.name, column.width), column.width, side));
    rule += fmt::format("{}{}", space, horizontal_rule(column.width));
  }
  write_line(sink_, names);
  write_line(sink_, rule);
}

void TableWriter::write_row(std::size_t row) {
  std::string line;
  for (std::size_t i = 0; i < columns_.size(); ++i) {
    const Column& column = columns_[i];
    const Side side = column.is_number[row] ? Side::right : Side::left;
    if (i > 0) line += gap;
    line += filled(shortened(column.texts[row], column.width), column.width, side);
  }
  write_line(sink_, line);
}

void TableWriter::end() {
  if (columns_.empty()) return;
  if (!fit() && num_rows_ > 0) {
    write_records();
  } else {
    write_names();
    for (std::size_t row = 0; row < num_rows_; ++row) write_row(row);
  }
  if (has_more_) sink_(fmt::format("the first {} rows (more with --rows-max)\n", num_rows_));
}

/// A table of GitHub's Markdown, with all rows; columns whose first value is a number stand to the
/// right.
class MarkdownWriter : public RowWriter {
 public:
  explicit MarkdownWriter(TextSink sink) : sink_(std::move(sink)) {}
  void begin(std::span<const std::string> columns) override;
  [[nodiscard]] bool row(std::span<const Cell> cells) override;
  void end() override;

 private:
  void write_rule(std::span<const Cell> cells);

  TextSink sink_;
  std::size_t num_columns_ = 0;
  bool has_rule_ = false;
};

void MarkdownWriter::begin(std::span<const std::string> columns) {
  num_columns_ = columns.size();
  std::string line = "|";
  for (const std::string& name : columns)
    line += fmt::format(" {} |", markdown_text(wire::visible_text(name)));
  sink_(line + "\n");
}

void MarkdownWriter::write_rule(std::span<const Cell> cells) {
  std::string line = "|";
  for (std::size_t i = 0; i < num_columns_; ++i) {
    line += i < cells.size() && is_number(cells[i]) ? " ---: |" : " --- |";
  }
  sink_(line + "\n");
  has_rule_ = true;
}

bool MarkdownWriter::row(std::span<const Cell> cells) {
  if (!has_rule_) write_rule(cells);
  std::string line = "|";
  for (const Cell& cell : cells) {
    line += fmt::format(" {} |", markdown_text(wire::visible_text(cell_text(cell))));
  }
  sink_(line + "\n");
  return true;
}

void MarkdownWriter::end() {
  if (!has_rule_) write_rule({});
}

}  // namespace

std::unique_ptr<RowWriter> make_row_writer(RowFormat format, const TableLimits& limits,
                                           TextSink sink) {
  switch (format) {
    case RowFormat::table:
      return std::make_unique<TableWriter>(limits, std::move(sink));
    case RowFormat::csv:
      return std::make_unique<CsvWriter>(std::move(sink));
    case RowFormat::json:
      return std::make_unique<JsonWriter>(std::move(sink));
    case RowFormat::markdown:
      return std::make_unique<MarkdownWriter>(std::move(sink));
  }
  PROOFMASS_EXPECT(false);
  return nullptr;
}

}  // namespace proofmass::coordinator
