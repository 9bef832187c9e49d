#pragma once

#include <nlohmann/json.hpp>
#include <optional>

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

}  // namespace proofmass::coordinator
