#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

namespace proofmass::wire {

/// The object of JSON that a program says in a line. A number beyond the range of doubles, which
/// JSON allows, is null, as what is not finite is. What is nested deeper than a list of a law is no
/// part of any answer, and is left out.
/// @throws InvalidArgument `is no object of JSON`, `has NaN at character 9, ...`, or `has the key
///         "scale" twice`.
[[nodiscard]] nlohmann::json object_in(std::string_view line);

/// Its beginning, as messages show it.
[[nodiscard]] std::string excerpt_of(std::string_view line);

}  // namespace proofmass::wire
