#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>

namespace proofmass::coordinator {

/// Bytes that are no text.
struct Blob {
  std::string_view bytes;
};

/// A value of SQL; monostate is NULL. Text and bytes live until the next row.
using Value = std::variant<std::monostate, std::int64_t, double, std::string_view, Blob>;

/// The shortest text that reads back as the same double: `0.1`, `1e+20`, `-0`, `inf`.
[[nodiscard]] std::string shortest_text(double value);

/// Numbers in shortest form, text as it is, bytes as SQL writes them, `x'00ff'`, NULL as nothing.
[[nodiscard]] std::string text_of(const Value& value);

[[nodiscard]] bool is_number(const Value& value);

/// What becomes of the rows of a query: begin() once, row() for each until it wants no more, end()
/// once.
class RowWriter {
 public:
  virtual ~RowWriter() = default;
  /// @throws InvalidArgument if the format cannot hold such columns.
  virtual void begin(std::span<const std::string> columns) = 0;
  /// @returns False if it wants no further row.
  [[nodiscard]] virtual bool row(std::span<const Value> values) = 0;
  virtual void end() = 0;
};

/// Takes the text of an output, piece by piece.
using TextSink = std::function<void(std::string_view)>;

enum class RowFormat : std::uint8_t { table, csv, json, markdown };

/// For people: what a table may take.
struct TableLimits {
  std::size_t num_rows_max = 1000;         ///< Whether there are more is said.
  std::optional<std::size_t> num_columns;  ///< Of the terminal; empty if it is none.
};

/// A writer of the format, which README.md describes.
[[nodiscard]] std::unique_ptr<RowWriter> make_row_writer(RowFormat format,
                                                         const TableLimits& limits, TextSink sink);

}  // namespace proofmass::coordinator
