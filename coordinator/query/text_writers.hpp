#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "coordinator/query/row_writer.hpp"

namespace proofmass::coordinator {

// Formats for people.

/// Columns side by side under their names, numbers to the right. Shows the first rows; cuts text,
/// never a number, to fit the terminal, and elsewhere to 100 columns.
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

  void fit();
  void write_names();
  void write_row(std::size_t row);

  TableLimits limits_;
  TextSink sink_;
  std::vector<Column> columns_;
  std::size_t num_rows_ = 0;
  bool has_more_ = false;
};

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

}  // namespace proofmass::coordinator
