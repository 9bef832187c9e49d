#pragma once

#include <filesystem>
#include <string_view>

#include "coordinator/store/draft_file.hpp"

namespace proofmass::coordinator {

/// @throws UsageError `output = path (why)`.
[[noreturn]] void refuse_output(const std::filesystem::path& output, std::string_view why);

/// Checks that a file may be written, or take the place of what has its name: a device or a
/// campaign would be lost.
/// @param remedy  What to tell people whose output is no file.
/// @throws UsageError `output = path (rule)`.
void check_output_file(const std::filesystem::path& output, IfThere if_there,
                       std::string_view remedy);

}  // namespace proofmass::coordinator
