#include "coordinator/campaign_file/data_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <fstream>
#include <optional>
#include <set>
#include <system_error>

#include "core/definition/nearest_name.hpp"

namespace proofmass::coordinator::detail {

std::string read_text_file(const std::filesystem::path& file, std::uintmax_t size_max) {
  std::error_code error;
  if (std::filesystem::is_directory(file, error)) throw UnreadableFile("is a directory");
  errno = 0;
  std::ifstream stream(file, std::ios::binary);
  if (!stream) {
    throw UnreadableFile("cannot be read: " + std::generic_category().message(errno));
  }
  // One byte more than allowed tells a file that is too large, also one without a known size.
  std::string text(static_cast<std::size_t>(size_max) + 1, '\0');
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (stream.bad()) throw UnreadableFile("cannot be read");
  text.resize(static_cast<std::size_t>(stream.gcount()));
  if (text.size() > size_max) {
    throw UnreadableFile(fmt::format("is larger than {} bytes", size_max));
  }
  text.shrink_to_fit();
  return text;
}

namespace {

constexpr std::array<std::string_view, 7> environment_headings{
    "time_s",           "linear_x_m_s2",    "linear_y_m_s2",   "linear_z_m_s2",
    "angular_x_rad_s2", "angular_y_rad_s2", "angular_z_rad_s2"};

std::string_view trimmed(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(" \t");
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(" \t") - begin + 1);
}

/// Goes through comma-separated lines; cells are trimmed, carriage returns at line ends dropped.
class CsvReader {
 public:
  CsvReader(std::string_view text, const std::string& name) : rest_(text), name_(name) {}

  /// Moves to the next line, false behind the last.
  bool next_row() {
    if (rest_.empty()) return false;
    const std::size_t end = std::min(rest_.find('\n'), rest_.size());
    std::string_view line = rest_.substr(0, end);
    rest_.remove_prefix(std::min(end + 1, rest_.size()));
    if (line.ends_with('\r')) line.remove_suffix(1);
    ++line_;
    split(line);
    return true;
  }

  [[nodiscard]] const std::vector<std::string_view>& cells() const { return cells_; }

  [[nodiscard]] double number(std::size_t position, std::string_view heading) const {
    const std::string_view cell = cells_[position];
    double value = 0.0;
    const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
    if (error != std::errc() || end != cell.data() + cell.size()) {
      refuse(fmt::format("{} = \"{}\" (must be a number)", heading, cell.substr(0, 40)));
    }
    if (!std::isfinite(value)) refuse(fmt::format("{} = {} (must be finite)", heading, cell));
    return value;
  }

  void expect_cells(std::size_t num_cells) const {
    if (cells_.size() == num_cells) return;
    refuse(fmt::format("{} cells (must be {})", cells_.size(), num_cells));
  }

  [[noreturn]] void refuse(std::string_view reason) const {
    throw DefinitionError(fmt::format("{}:{}: {}", name_, std::max<std::size_t>(line_, 1), reason));
  }

 private:
  void split(std::string_view line) {
    cells_.clear();
    for (;;) {
      const std::size_t comma = std::min(line.find(','), line.size());
      cells_.push_back(trimmed(line.substr(0, comma)));
      if (comma == line.size()) return;
      line.remove_prefix(comma + 1);
    }
  }

  std::string_view rest_;
  const std::string& name_;
  std::size_t line_ = 0;
  std::vector<std::string_view> cells_;
};

// Row i of an environment table stands in line i + 1, below the headings.
DefinitionError located_in_table(const ConfigError& error, const std::string& name) {
  constexpr std::string_view row_prefix = "environment.file row ";
  std::size_t row = 0;
  if (error.field().starts_with(row_prefix)) {
    const char* const digits = error.field().data() + row_prefix.size();
    std::from_chars(digits, error.field().data() + error.field().size(), row);
  }
  return DefinitionError(fmt::format("{}:{}: {}", name, row + 1, error.what()));
}

std::size_t find_heading(const CsvReader& reader, std::string_view heading) {
  const std::vector<std::string_view>& headings = reader.cells();
  const auto match = std::ranges::find(headings, heading);
  if (match == headings.end()) {
    const std::optional<std::string> nearest =
        nearest_name(heading, std::set<std::string>(headings.begin(), headings.end()));
    reader.refuse(fmt::format("no column \"{}\"{}", heading,
                              nearest ? "; nearest is \"" + *nearest + "\"" : ""));
  }
  if (std::ranges::count(headings, heading) > 1) {
    reader.refuse(fmt::format("two columns \"{}\"", heading));
  }
  return static_cast<std::size_t>(match - headings.begin());
}

}  // namespace

EnvironmentTable parse_environment(std::string_view text, const std::string& name,
                                   double orbit_period_s) {
  CsvReader reader(text, name);
  if (!reader.next_row() || !std::ranges::equal(reader.cells(), environment_headings)) {
    reader.refuse(fmt::format("the first line must be {}", fmt::join(environment_headings, ",")));
  }
  EnvironmentTable table;
  while (reader.next_row()) {
    if (table.size() == environment_rows_max) {
      reader.refuse(fmt::format("more than {} rows", environment_rows_max));
    }
    reader.expect_cells(environment_headings.size());
    const auto number = [&](std::size_t i) { return reader.number(i, environment_headings[i]); };
    table.push_back({.time_s = number(0),
                     .linear_m_s2 = {number(1), number(2), number(3)},
                     .angular_rad_s2 = {number(4), number(5), number(6)}});
  }
  try {
    validate_environment_table(table, orbit_period_s);
  } catch (const ConfigError& error) {
    throw located_in_table(error, name);
  }
  return table;
}

std::vector<double> parse_column(std::string_view text, const std::string& name,
                                 std::string_view heading) {
  CsvReader reader(text, name);
  if (!reader.next_row()) reader.refuse("the file is empty; its first line must hold the headings");
  const std::size_t num_cells = reader.cells().size();
  const std::size_t position = find_heading(reader, heading);
  std::vector<double> values;
  while (reader.next_row()) {
    reader.expect_cells(num_cells);
    values.push_back(reader.number(position, heading));
  }
  return values;
}

}  // namespace proofmass::coordinator::detail
