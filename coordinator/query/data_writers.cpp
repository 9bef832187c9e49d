#include "coordinator/query/data_writers.hpp"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "coordinator/query/cell_text.hpp"
#include "core/error.hpp"

namespace proofmass::coordinator {
namespace {

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

}  // namespace

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

}  // namespace proofmass::coordinator
