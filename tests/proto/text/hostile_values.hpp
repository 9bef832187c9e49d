#pragma once

#include <array>
#include <string_view>

namespace proofmass::test {

/// What files and peers could say to pass for fields, events or commands to a terminal.
inline constexpr std::array<std::string_view, 16> hostile_values{
    "told to stop",
    "x\" level=info y=\"",
    "\"",
    "\\",
    "\\\"",
    "ends with \\",
    "a\\nb is no end of a line",
    "refused\n[2026] [info] worker_ended reason=forged",
    "\r\ttabs\t",
    "\x1b[2J",
    "\xc2\x9b"
    "31m",
    "\xe2\x80\xae"
    "backwards",
    "campaign=7",
    "a = b (must be c)",
    "=",
    "s²/m Δ 測",
};

}  // namespace proofmass::test
