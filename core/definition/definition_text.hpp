#pragma once

#include <span>
#include <string>
#include <string_view>

namespace proofmass::detail {

/// Shortest decimal that reads back to the same bits; valid TOML. The value is finite.
[[nodiscard]] std::string number_text(double value);

/// A TOML basic string, escaped.
[[nodiscard]] std::string quoted_text(std::string_view text);

/// `"a", "b" or "c"`.
[[nodiscard]] std::string alternatives(std::span<const std::string_view> names);

}  // namespace proofmass::detail
