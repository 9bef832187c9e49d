#pragma once

#include <filesystem>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/detail/file_place.hpp"

namespace proofmass::coordinator::detail {

/// Writes the open file to the name that it has lost, complete or not at all.
///
/// The write-ahead log beside the name is removed first if it is that of the open file: it would be
/// applied to whatever has the name next.
/// @param placement  `removed`: the name must still be free. `replaced`: what has the name now must
///                   be an older copy of the same campaign, none of whose results differ; the
///                   open file has all that is in it, and takes its place.
/// @throws StoreError with the reason if that cannot be done; the open file is as it was.
void restore_name(const std::filesystem::path& path, Database& open_file, const FilePlace& place,
                  Placement placement);

}  // namespace proofmass::coordinator::detail
