#pragma once

#include <cstddef>
#include <cstdio>
#include <string_view>

#include "coordinator/table/terminal_table.hpp"

namespace proofmass::coordinator {

struct ScreenSize {
  std::size_t columns = 80;
  std::size_t rows = 24;
};

/// Size of the terminal; the default if it is none.
[[nodiscard]] ScreenSize screen_size_of(std::FILE* stream);

/// True if the stream is a terminal that obeys control sequences: TERM is neither unset nor `dumb`.
[[nodiscard]] bool takes_escapes(std::FILE* stream);

/// How tables are written to the stream. A line may take the columns of the terminal but the last,
/// or any number if the stream is a file or a pipe. A terminal that obeys control sequences is
/// painted unless NO_COLOR is set and not empty (https://no-color.org).
[[nodiscard]] TerminalStyle style_of(std::FILE* stream);

/// Prints lines, which may hold text of a file from elsewhere, as wire::visible_lines().
/// @throws Error `standard output: No space left on device`.
void print_lines(std::string_view text);

/// Writes bytes as they are: answers for programs, and text that is visible already, as that of
/// terminal_text().
/// @throws Error as print_lines().
void write_standard_output(std::string_view text);

/// Writes what is still buffered; without it a full disk goes unnoticed.
/// @throws Error as print_lines().
void flush_standard_output();

}  // namespace proofmass::coordinator
