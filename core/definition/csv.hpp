#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace proofmass {

/// Goes through lines of comma-separated text; cells are trimmed, carriage returns at line ends
/// dropped. A cell may be quoted as in RFC 4180, within its line; a quote in it stays doubled. Text
/// and name outlive it.
class CsvReader {
 public:
  /// @param name  For messages: path of the file that has the text.
  CsvReader(std::string_view text, const std::string& name) : rest_(text), name_(name) {}

  /// Moves to the next line, false behind the last.
  bool next_row();
  [[nodiscard]] const std::vector<std::string_view>& cells() const { return cells_; }
  /// The place of the cell that has this text, in a line of headings.
  /// @throws DefinitionError naming file and line if there is none, or more than one.
  [[nodiscard]] std::size_t position_of(std::string_view heading) const;
  /// The number in a cell of the line.
  /// @throws DefinitionError naming file, line, heading and rule.
  [[nodiscard]] double number(std::size_t position, std::string_view heading) const;
  /// @throws DefinitionError naming file and line if the line has another number of cells.
  void expect_cells(std::size_t num_cells) const;
  /// @throws DefinitionError naming file and line, with this reason.
  [[noreturn]] void refuse(std::string_view reason) const;

 private:
  void split(std::string_view line);
  /// The place behind the closing quote of a text that begins with one.
  [[nodiscard]] std::size_t end_of_quoted(std::string_view text) const;

  std::string_view rest_;
  const std::string& name_;
  std::size_t line_ = 0;
  std::vector<std::string_view> cells_;
};

/// One column, by its heading, of comma-separated text whose first line holds the headings.
/// @throws DefinitionError naming file, line and reason.
[[nodiscard]] std::vector<double> parse_column(std::string_view text, const std::string& name,
                                               std::string_view heading);

}  // namespace proofmass
