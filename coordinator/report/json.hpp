#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "core/statistics/interval.hpp"

/// What is missing is null.
template <typename Value>
struct nlohmann::adl_serializer<std::optional<Value>> {
  template <typename Json>
  static void to_json(Json& json, const std::optional<Value>& value) {
    json = value ? Json(*value) : Json(nullptr);
  }
};

namespace proofmass {

/// `[lower, upper]`.
inline void to_json(nlohmann::ordered_json& json, const Interval& interval) {
  json = {interval.lower, interval.upper};
}

}  // namespace proofmass

namespace proofmass::coordinator {

/// Objects for programs keep the order of their keys.
using Json = nlohmann::ordered_json;

/// Object on one line or on several; ends with the end of a line.
enum class JsonLayout : std::uint8_t { one_line, indented };

/// The text of an object. Bytes of it that are not UTF-8 are replaced by U+FFFD.
[[nodiscard]] inline std::string dumped(const Json& json, JsonLayout layout) {
  constexpr auto replace = Json::error_handler_t::replace;
  return json.dump(layout == JsonLayout::indented ? 2 : -1, ' ', false, replace) + "\n";
}

/// What `json_of` makes of each, as an array.
template <typename Range, typename JsonOf>
[[nodiscard]] Json array_of(const Range& all, const JsonOf& json_of) {
  Json array = Json::array();
  for (const auto& one : all) array.push_back(json_of(one));
  return array;
}

/// Null where there is nothing to say.
[[nodiscard]] inline Json text_or_null(const std::string& text) {
  return text.empty() ? Json(nullptr) : Json(text);
}

}  // namespace proofmass::coordinator
