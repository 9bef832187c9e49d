#pragma once

#include <filesystem>
#include <string_view>

#include "proto/link/whole_file.hpp"

namespace proofmass::coordinator {

/// @throws UsageError `output = path (why)`.
[[noreturn]] void refuse_output(const std::filesystem::path& output, std::string_view why);

/// Checks that a file may be written, or take the place of what has its name: a device or a
/// campaign would be lost.
/// @param remedy  What to tell people whose output is no file.
/// @throws UsageError `output = path (rule)`.
void check_output_file(const std::filesystem::path& output, wire::IfThere if_there,
                       std::string_view remedy);

/// Writes a file that is whole or not there at any time.
/// @throws Error `output = path (reason)`.
void write_output_file(const std::filesystem::path& output, wire::IfThere if_there,
                       std::string_view text);

/// Both for a text whose file may be `-`, standard output.
void check_document(const std::filesystem::path& file, wire::IfThere if_there);
void write_document(const std::filesystem::path& file, wire::IfThere if_there,
                    std::string_view text);

/// Checks that a file can be made which replaces nothing.
/// @param argument  What names the file, for the message.
/// @throws UsageError `argument = path (exists already)`, or Error if the directory that is to hold
///         it does not exist.
void check_new_file(std::string_view argument, const std::filesystem::path& file);

}  // namespace proofmass::coordinator
