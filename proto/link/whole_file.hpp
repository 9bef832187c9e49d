#pragma once

#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <string_view>

namespace proofmass::wire {

enum class IfExists : std::uint8_t { refuse, replace };

/// Writes a file that is whole or not there at any time, also after a crash.
///
/// @param what  What the file is, for messages: `key file`.
/// @param mode  Permissions, whatever the umask.
/// @throws Error reading `what = PATH (reason)`.
void write_whole_file(std::string_view what, const std::filesystem::path& file,
                      std::string_view text, mode_t mode, IfExists if_exists);

}  // namespace proofmass::wire
