#pragma once

#include <span>
#include <string>

#include "coordinator/archive/verification.hpp"
#include "proto/link/whole_file.hpp"

namespace proofmass::coordinator {

/// Writes an archive (tar, gzip) with which others can check, repeat and cite a campaign: README.md
/// lists its files. It is of one state of the database, which a coordinator may be writing to. The
/// same database gives the same bytes.
///
/// @param authors  For the citation.
/// @throws StoreError if the database cannot be read or is damaged; DefinitionError or ArchiveError
///         if this program cannot make its campaign again; Error if the archive cannot be written;
///         Interrupted. Then no file appears.
void publish(const std::filesystem::path& database, const std::filesystem::path& archive,
             wire::IfThere if_there, std::span<const std::string> authors,
             const IsStopped& is_stopped);

/// Checks an archive from elsewhere: `checksums`, `campaign`, then all of verify(). It is unpacked
/// to the temporary directory, where nothing of it remains.
///
/// @param report  As of verify().
/// @return True if no check fails.
/// @throws ArchiveError `archive = FILE (why)` if it is not one folder with plain files, is damaged
///         or unpacks to over 256 MiB and 64 times its size; Interrupted.
[[nodiscard]] bool check_publication(const std::filesystem::path& archive,
                                     const VerifyOptions& options,
                                     const std::function<void(const Check&)>& report,
                                     const IsStopped& is_stopped);

}  // namespace proofmass::coordinator
