#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace proofmass::coordinator {

/// What the target of a request says, decoded: `/campaigns/a%20b?events=2` has the path
/// {campaigns, a b} and the parameter events.
struct PageRequest {
  std::vector<std::string> path =
      {};  ///< None for `/`. No part is empty, `.` or `..`, or has a `/`.
  std::map<std::string, std::string> parameters = {};

  [[nodiscard]] bool has(const std::string& parameter) const {
    return parameters.contains(parameter);
  }
  /// Empty if it is not there.
  [[nodiscard]] std::string text(const std::string& parameter) const;
  /// The value as a whole number; nothing if it is not there or no such number.
  [[nodiscard]] std::optional<std::uint64_t> number(const std::string& parameter) const;
};

/// Reads a target. Nothing if it is no path from `/` on, is badly encoded, has a part that is
/// empty, `.` or `..` or hides a `/` or a NUL, or has more than 16 parameters.
[[nodiscard]] std::optional<PageRequest> parse_target(std::string_view target);

/// Text as a part of a path or the value of a parameter: all but letters, digits and `-._~` is
/// written `%20`.
[[nodiscard]] std::string percent_encoded(std::string_view text);

}  // namespace proofmass::coordinator
