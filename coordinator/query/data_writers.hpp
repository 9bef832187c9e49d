#pragma once

#include <string>
#include <vector>

#include "coordinator/query/row_writer.hpp"

namespace proofmass::coordinator {

// Formats for programs, which lose nothing and hold any number of rows.

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

}  // namespace proofmass::coordinator
