#pragma once

#include <filesystem>

namespace proofmass::coordinator {

/// True if the first bytes of a file say that it is a campaign file, whole or damaged; false if it
/// cannot be read. Opens no database.
[[nodiscard]] bool has_campaign_mark(const std::filesystem::path& file);

}  // namespace proofmass::coordinator
