#pragma once

#include <filesystem>

namespace proofmass::coordinator {

/// True if the first bytes of a file say that it is a campaign file, whole or damaged; false if it
/// cannot be read or is a directory, pipe or device. Opens no database.
[[nodiscard]] bool has_campaign_mark(const std::filesystem::path& file);

/// True if it has the mark, or is a file that this user may not read.
[[nodiscard]] bool may_be_campaign(const std::filesystem::path& file);

}  // namespace proofmass::coordinator
