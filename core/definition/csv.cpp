#include "core/definition/csv.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <set>

#include "core/campaign/definition.hpp"
#include "core/definition/definition_text.hpp"

namespace proofmass {
namespace {

std::string_view trimmed(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(" \t");
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(" \t") - begin + 1);
}

}  // namespace

bool CsvReader::next_row() {
  if (rest_.empty()) return false;
  const std::size_t end = std::min(rest_.find('\n'), rest_.size());
  std::string_view line = rest_.substr(0, end);
  rest_.remove_prefix(std::min(end + 1, rest_.size()));
  if (line.ends_with('\r')) line.remove_suffix(1);
  ++line_;
  split(line);
  return true;
}

std::size_t CsvReader::position_of(std::string_view heading) const {
  const auto match = std::ranges::find(cells_, heading);
  if (match == cells_.end()) {
    const std::optional<std::string> nearest =
        nearest_name(heading, std::set<std::string>(cells_.begin(), cells_.end()));
    const bool is_one = cells_.size() == 1;
    refuse(fmt::format("no column \"{}\"{}{}", heading,
                       nearest ? "; nearest is \"" + *nearest + "\"" : "",
                       is_one ? "; commas separate columns" : ""));
  }
  if (std::ranges::count(cells_, heading) > 1) {
    refuse(fmt::format("two columns \"{}\"", heading));
  }
  return static_cast<std::size_t>(match - cells_.begin());
}

double CsvReader::number(std::size_t position, std::string_view heading) const {
  std::string_view cell = cells_[position];
  double value = 0.0;
  if (cell.starts_with('+') && !cell.starts_with("+-"))
    cell.remove_prefix(1);  // As other programs write it.
  const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
  if (error != std::errc() || end != cell.data() + cell.size()) {
    refuse(fmt::format("{} = \"{}\" (must be a number)", heading, cell.substr(0, 40)));
  }
  if (!std::isfinite(value)) refuse(fmt::format("{} = {} (must be finite)", heading, cell));
  return value;
}

void CsvReader::expect_cells(std::size_t num_cells) const {
  if (cells_.size() == num_cells) return;
  if (cells_.size() == 1 && cells_.front().empty()) refuse("the line is empty");
  refuse(fmt::format("{} cells (must be {})", cells_.size(), num_cells));
}

void CsvReader::refuse(std::string_view reason) const {
  throw DefinitionError(fmt::format("{}:{}: {}", name_, std::max<std::size_t>(line_, 1), reason));
}

void CsvReader::split(std::string_view line) {
  cells_.clear();
  for (;;) {
    line.remove_prefix(std::min(line.find_first_not_of(" \t"), line.size()));
    const std::size_t quoted = line.starts_with('"') ? end_of_quoted(line) : 0;
    const std::size_t comma = std::min(line.find(',', quoted), line.size());
    const std::string_view behind = trimmed(line.substr(quoted, comma - quoted));
    if (quoted > 0 && !behind.empty()) refuse("a comma must follow a closing quote");
    cells_.push_back(quoted > 0 ? line.substr(1, quoted - 2) : behind);
    if (comma == line.size()) return;
    line.remove_prefix(comma + 1);
  }
}

std::size_t CsvReader::end_of_quoted(std::string_view text) const {
  for (std::size_t quote = text.find('"', 1); quote != std::string_view::npos;
       quote = text.find('"', quote + 2)) {
    if (!text.substr(quote + 1).starts_with('"')) return quote + 1;
  }
  refuse("a quote does not end in its line");
}

std::vector<double> parse_column(std::string_view text, const std::string& name,
                                 std::string_view heading) {
  CsvReader reader(text, name);
  if (!reader.next_row()) reader.refuse("the file is empty; its first line must hold the headings");
  const std::size_t num_cells = reader.cells().size();
  const std::size_t position = reader.position_of(heading);
  std::vector<double> values;
  while (reader.next_row()) {
    reader.expect_cells(num_cells);
    values.push_back(reader.number(position, heading));
  }
  return values;
}

}  // namespace proofmass
