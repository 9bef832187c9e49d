#pragma once

#include <filesystem>

struct sqlite3;

namespace proofmass::coordinator::detail {

/// A connection to a private copy of a campaign file of an older version, brought up to date; see
/// Database::go_on_with_private_copy(). The caller closes it.
/// @throws StoreError as Store::open_read_only() does.
[[nodiscard]] sqlite3* open_private_copy(const std::filesystem::path& file);

}  // namespace proofmass::coordinator::detail
