#pragma once

#include <string>
#include <string_view>

namespace proofmass::wire {

/// True for 1 to 128 of [A-Za-z0-9._-]: names of workers, hosts and models, which go into logs and
/// the database as they are.
[[nodiscard]] bool is_name(std::string_view text);

/// The text with every character that a name may not have replaced by `-`, cut to 128; `unnamed` if
/// nothing is left.
[[nodiscard]] std::string name_from(std::string_view text);

}  // namespace proofmass::wire
