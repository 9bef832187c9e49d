#include "proto/model_program/json_line.hpp"

#include <fmt/format.h>
#include <utf8.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <set>

#include "core/error.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::wire {
namespace {

using Json = nlohmann::json;

/// With null for each number that the parser takes for an error, because a double does not hold it.
std::string without_overflow(std::string_view line) {
  std::string text;
  bool is_in_string = false;
  while (!line.empty()) {
    std::size_t size = is_in_string && line.front() == '\\' ? 2 : 1;
    if (!is_in_string) size = std::max(size, line.find_first_not_of("+-.0123456789Ee"));
    std::string part(line.substr(0, size));
    if (!is_in_string && std::isinf(std::strtod(part.c_str(), nullptr))) part = "null";
    if (part == "\"") is_in_string = !is_in_string;
    text += part;
    line.remove_prefix(std::min(size, line.size()));
  }
  return text;
}

/// A text in Latin-1 looks right in an excerpt.
/// @throws InvalidArgument if what begins as an object is no UTF-8.
void refuse_other_encoding(std::string_view line) {
  const auto* const invalid = utf8::find_invalid(line.begin(), line.end());
  if (!line.starts_with('{') || invalid == line.end()) return;
  throw InvalidArgument(fmt::format("is no UTF-8 at byte {}", invalid - line.begin() + 1));
}

/// Python's json module writes such numbers, far behind what an excerpt shows.
/// @throws InvalidArgument if what begins as an object has one.
void refuse_non_finite(std::string_view line) {
  if (!line.starts_with('{')) return;
  bool is_in_string = false;
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (line[i] == '"') is_in_string = !is_in_string;
    if (is_in_string && line[i] == '\\') ++i;
    if (is_in_string) continue;
    for (const std::string_view number : {"NaN", "Infinity"}) {
      if (!line.substr(i).starts_with(number)) continue;
      throw InvalidArgument(
          fmt::format("has {} at character {}, a number that JSON does not have", number, i + 1));
    }
  }
}

}  // namespace

Json object_in(std::string_view line) {
  constexpr int depth_max = 4;  // Deeper ones would have to be written by a recursive function.
  std::map<int, std::set<std::string>> keys;  // Of the innermost object of each depth.
  std::string twice;
  const auto is_kept = [&](int depth, Json::parse_event_t event, const Json& parsed) {
    if (event == Json::parse_event_t::object_start) keys[depth + 1].clear();
    if (event == Json::parse_event_t::key && !keys[depth].insert(parsed).second) twice = parsed;
    return depth <= depth_max;
  };
  Json json = Json::parse(line, is_kept, false);
  if (json.is_discarded()) json = Json::parse(without_overflow(line), is_kept, false);
  if (json.is_discarded()) {
    refuse_other_encoding(line);
    refuse_non_finite(line);
  }
  if (!json.is_object()) throw InvalidArgument("is no object of JSON");
  if (!twice.empty())
    throw InvalidArgument(fmt::format("has the key \"{}\" twice", excerpt_of(twice)));
  return json;
}

std::string excerpt_of(std::string_view line) {
  constexpr std::size_t size_max = 80;
  return visible_text(line.substr(0, size_max)) + (line.size() > size_max ? "..." : "");
}

}  // namespace proofmass::wire
