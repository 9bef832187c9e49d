#include "coordinator/cli/event_format.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <string_view>

#include "core/error.hpp"

namespace proofmass::coordinator {
namespace {

/// The next word of a text, which is taken off it; a part in quotes belongs to its word.
std::string_view take_word(std::string_view& text) {
  bool is_quoted = false;
  std::size_t end = 0;
  for (; end < text.size() && (is_quoted || text[end] != ' '); ++end) {
    if (text[end] == '"') is_quoted = !is_quoted;
  }
  const std::string_view word = text.substr(0, end);
  text.remove_prefix(std::min(end + 1, text.size()));
  return word;
}

std::string_view unquoted(std::string_view value) {
  const bool is_quoted = value.size() >= 2 && value.front() == '"' && value.back() == '"';
  return is_quoted ? value.substr(1, value.size() - 2) : value;
}

}  // namespace

std::string_view name_of(Severity severity) {
  switch (severity) {
    case Severity::info:
      return "info";
    case Severity::warning:
      return "warning";
    case Severity::error:
      return "error";
  }
  PROOFMASS_EXPECT(false);
}

std::string json_line(const Event& event, std::chrono::system_clock::time_point time) {
  nlohmann::ordered_json line;
  const auto second = std::chrono::floor<std::chrono::seconds>(time);
  const auto part = std::chrono::floor<std::chrono::milliseconds>(time - second);
  line["time"] = fmt::format("{:%FT%T}.{:03}Z", second, part.count());
  line["level"] = name_of(event.severity);
  line["event"] = event.kind;
  std::string rest;
  for (std::string_view text = event.text; !text.empty();) {
    const std::string_view word = take_word(text);
    const std::size_t equals = word.find('=');
    if (equals != std::string_view::npos && equals > 0) {
      line[std::string(word.substr(0, equals))] = unquoted(word.substr(equals + 1));
    } else {
      rest += fmt::format("{}{}", rest.empty() ? "" : " ", word);
    }
  }
  if (!rest.empty()) line["text"] = rest;
  // What a peer says need not be UTF-8.
  return line.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace proofmass::coordinator
