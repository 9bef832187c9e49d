#include "coordinator/query/row_writer.hpp"

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>
#include <vector>

#include "coordinator/table/table.hpp"
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
  const auto* const bytes = reinterpret_cast<const unsigned char*>(blob.bytes.data());
  return fmt::format("x'{:02x}'", fmt::join(bytes, bytes + blob.bytes.size(), ""));
}

std::string text_of(const Value& value) { return std::visit(TextOf{}, value); }

bool is_number(const Value& value) {
  return std::holds_alternative<std::int64_t>(value) || std::holds_alternative<double>(value);
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

std::string csv_value(const Value& value) {
  const auto* text = std::get_if<std::string_view>(&value);
  return text == nullptr ? text_of(value) : csv_text(*text);
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

std::string json_value(const Value& value) {
  if (std::holds_alternative<std::monostate>(value)) return "null";
  if (const auto* text = std::get_if<std::string_view>(&value)) return json_text(*text);
  if (const auto* real = std::get_if<double>(&value)) return json_number(*real);
  return is_number(value) ? text_of(value) : json_text(text_of(value));
}

/// [RFC4180]: lines end in CR LF, the first has the names of the columns. NULL is an empty field,
/// empty text is `""`.
class CsvWriter : public RowWriter {
 public:
  explicit CsvWriter(TextSink sink) : sink_(std::move(sink)) {}
  void begin(std::span<const std::string> columns) override {
    std::string line;
    for (const std::string& column : columns) {
      line += fmt::format("{}{}", line.empty() ? "" : ",", csv_text(column));
    }
    sink_(line + "\r\n");
  }

  [[nodiscard]] bool row(std::span<const Value> values) override {
    std::string line;
    for (std::size_t i = 0; i < values.size(); ++i) {
      line += fmt::format("{}{}", i == 0 ? "" : ",", csv_value(values[i]));
    }
    // Readers pass over empty lines.
    sink_((line.empty() ? "\"\"" : line) + "\r\n");
    return true;
  }

  void end() override {}

 private:
  TextSink sink_;
};

/// [RFC8259]: a list with an object a row. Infinity is the number 1e999; what is not UTF-8 in a
/// text becomes U+FFFD.
class JsonWriter : public RowWriter {
 public:
  explicit JsonWriter(TextSink sink) : sink_(std::move(sink)) {}
  /// @throws InvalidArgument if two columns have the same name: readers keep one of them.
  void begin(std::span<const std::string> columns) override {
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

  [[nodiscard]] bool row(std::span<const Value> values) override {
    std::string line = has_rows_ ? ",\n {" : "\n {";
    for (std::size_t i = 0; i < values.size(); ++i) {
      line += fmt::format("{}{}: {}", i == 0 ? "" : ", ", keys_[i], json_value(values[i]));
    }
    sink_(line + "}");
    has_rows_ = true;
    return true;
  }

  void end() override { sink_(has_rows_ ? "\n]\n" : "]\n"); }

 private:
  TextSink sink_;
  std::vector<std::string> keys_;  ///< Quoted.
  bool has_rows_ = false;
};

// Formats for people.

constexpr std::size_t text_width_max = 100;

// The other formats have all digits.
std::string figure_text(const Value& value) {
  const auto* real = std::get_if<double>(&value);
  return real == nullptr ? text_of(value) : fmt::format("{:.6g}", *real);
}

/// A table for a terminal, numbers with six significant digits. Shows the first rows. Cuts text,
/// never a number, to fit the terminal, and elsewhere to 100 columns; rows that do not fit even so
/// are written as records, a line a value.
class TableWriter : public RowWriter {
 public:
  TableWriter(const TableLimits& limits, TextSink sink) : limits_(limits), sink_(std::move(sink)) {}
  void begin(std::span<const std::string> columns) override {
    for (const std::string& name : columns) {
      table_.columns.push_back({.title = shortened(wire::visible_text(name), text_width_max)});
    }
  }

  [[nodiscard]] bool row(std::span<const Value> values) override {
    has_more_ = table_.rows.size() == limits_.num_rows_max;
    if (has_more_) return false;
    Row& row = table_.rows.emplace_back();
    for (std::size_t i = 0; i < values.size(); ++i) {
      // No more than this is ever shown, and a text may have megabytes.
      const std::string text =
          wire::visible_text(std::string_view(figure_text(values[i])).substr(0, 1000));
      Cell& cell = row.emplace_back(shortened(text, text_width_max));
      if (const auto* integer = std::get_if<std::int64_t>(&values[i])) {
        cell.value = static_cast<double>(*integer);
      } else if (const auto* real = std::get_if<double>(&values[i])) {
        cell.value = *real;
      } else if (!std::holds_alternative<std::monostate>(values[i])) {
        table_.columns[i].is_text = true;
      }
    }
    return true;
  }

  void end() override {
    if (table_.columns.empty()) return;
    if (has_more_) {
      table_.remarks.push_back(
          {fmt::format("the first {} rows (more with --rows-max)", table_.rows.size())});
    }
    TerminalStyle style;
    if (limits_.num_columns) style.line_width_max = *limits_.num_columns;
    sink_(terminal_text(table_, style));
  }

 private:
  TableLimits limits_;
  TextSink sink_;
  Table table_;
  bool has_more_ = false;
};

/// A table of GitHub's Markdown, with all rows; columns whose first value is a number stand to the
/// right.
class MarkdownWriter : public RowWriter {
 public:
  explicit MarkdownWriter(TextSink sink) : sink_(std::move(sink)) {}
  void begin(std::span<const std::string> columns) override {
    for (const std::string& name : columns) columns_.push_back({.title = name, .is_text = true});
  }

  [[nodiscard]] bool row(std::span<const Value> values) override {
    if (!has_heading_) write_heading(values);
    Row row;
    for (const Value& value : values) row.emplace_back(text_of(value));
    sink_(markdown_row(row));
    return true;
  }

  void end() override {
    if (!has_heading_) write_heading({});
  }

 private:
  void write_heading(std::span<const Value> values) {
    for (std::size_t i = 0; i < values.size(); ++i) columns_[i].is_text = !is_number(values[i]);
    sink_(markdown_heading(columns_));
    has_heading_ = true;
  }

  TextSink sink_;
  std::vector<Column> columns_;
  bool has_heading_ = false;
};

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
