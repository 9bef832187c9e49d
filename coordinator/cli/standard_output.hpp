#pragma once

#include <string_view>

namespace proofmass::coordinator {

/// Prints lines, which may hold text of a file from elsewhere, as wire::visible_lines().
/// @throws Error `standard output: No space left on device`.
void print_lines(std::string_view text);

/// Writes bytes as they are.
/// @throws Error as print_lines().
void write_standard_output(std::string_view text);

/// Writes what is still buffered; without it a full disk goes unnoticed.
/// @throws Error as print_lines().
void flush_standard_output();

}  // namespace proofmass::coordinator
