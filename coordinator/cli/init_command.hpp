#pragma once

#include <cstdint>
#include <filesystem>

namespace proofmass::coordinator {

enum class IfFileExists : std::uint8_t { refuse, replace };

/// Writes the paper's campaign, commented.
/// @return An ExitCode.
/// @throws UsageError if the file exists and must not be replaced, Error if it cannot be written.
[[nodiscard]] int write_campaign(const std::filesystem::path& file, IfFileExists if_exists);

}  // namespace proofmass::coordinator
