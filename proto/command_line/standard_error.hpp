#pragma once

#include <cstdio>
#include <string_view>

namespace proofmass::wire {

/// Tells whoever sits at the terminal. That it cannot be heard, on a full disk or by a closed
/// terminal, changes nothing and is no error: answers go to standard output.
void say(std::string_view text) noexcept;

/// The same on another stream.
void say_on(std::FILE* stream, std::string_view text) noexcept;

}  // namespace proofmass::wire
