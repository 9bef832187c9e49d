#pragma once

#include <cstddef>
#include <cstdio>
#include <string_view>

namespace proofmass::coordinator {

struct ScreenSize {
  std::size_t columns = 80;
  std::size_t rows = 24;
};

/// Size of the terminal; the default if it is none.
[[nodiscard]] ScreenSize screen_size_of(std::FILE* stream);

/// Columns that a line of a table may take: those of the terminal but the last, or any number if
/// the stream is a file or a pipe.
[[nodiscard]] std::size_t line_width_max_of(std::FILE* stream);

/// Prints lines, which may hold text of a file from elsewhere, as wire::visible_lines().
/// @throws Error `standard output: No space left on device`.
void print_lines(std::string_view text);

/// Prints tables and notes for people, painted if standard output is a terminal, see
/// takes_paint(). To a file or a pipe it writes what print_lines() does.
/// @throws Error as print_lines().
void print_tables(std::string_view text);

/// Writes bytes as they are.
/// @throws Error as print_lines().
void write_standard_output(std::string_view text);

/// Writes what is still buffered; without it a full disk goes unnoticed.
/// @throws Error as print_lines().
void flush_standard_output();

}  // namespace proofmass::coordinator
