#pragma once

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

/// The text of an object, which ends with the end of a line. Bytes of it that are not UTF-8 are
/// replaced by U+FFFD.
/// @param indent  Of its lines; below 0 it is one line.
[[nodiscard]] inline std::string dumped(const Json& json, int indent = 2) {
  return json.dump(indent, ' ', false, Json::error_handler_t::replace) + "\n";
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
