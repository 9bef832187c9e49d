#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string_view>

#include "coordinator/table/terminal_table.hpp"
#include "proto/link/whole_file.hpp"

namespace proofmass {
class Model;
}  // namespace proofmass

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

/// How a command prints what it found.
enum class OutputFormat : std::uint8_t { text, json };

/// Says what a model program is asked for that may take long: Model::reference_digest().
void say_reference_runs(const Model& model);

/// Says that a file was written.
void print_written(const std::filesystem::path& file, OutputFormat format);

/// Prints lines, which may hold text of a file from elsewhere, as wire::visible_lines().
/// @throws Error `standard output: No space left on device`.
void print_lines(std::string_view text);

/// Prints an object as JSON; bytes that are no UTF-8 become U+FFFD.
/// @throws Error as print_lines().
void print_json(const nlohmann::ordered_json& json);

/// Writes bytes as they are: answers for programs, and text that is visible already, as that of
/// terminal_text().
/// @throws Error as print_lines().
void write_standard_output(std::string_view text);

/// Writes what is still buffered; without it a full disk goes unnoticed.
/// @throws Error as print_lines().
void flush_standard_output();

// Files.

/// @throws UsageError `output = path (why)`.
[[noreturn]] void refuse_output(const std::filesystem::path& output, std::string_view why);

/// Checks that a file may be written, or take the place of what has its name: a device or a
/// campaign would be lost.
/// @param remedy  What to tell people whose output is no file.
/// @throws UsageError `output = path (rule)`.
void check_output_file(const std::filesystem::path& output, wire::IfThere if_there,
                       std::string_view remedy);

/// check_output_file() for a text whose file may be `-`, standard output, or empty, none.
void check_document(const std::filesystem::path& file, wire::IfThere if_there);
/// Writes a file that is whole or not there at any time, or to standard output for `-`.
/// @throws Error `output = path (reason)`.
void write_document(const std::filesystem::path& file, wire::IfThere if_there,
                    std::string_view text);

/// Checks that a file can be made which replaces nothing.
/// @param argument  What names the file, for the message.
/// @throws UsageError `argument = path (exists already)`, or Error if the directory that is to hold
///         it does not exist.
void check_new_file(std::string_view argument, const std::filesystem::path& file);

}  // namespace proofmass::coordinator
