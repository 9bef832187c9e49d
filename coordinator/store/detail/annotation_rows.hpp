#pragma once

#include <string>
#include <vector>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/records.hpp"

namespace proofmass::coordinator::detail {

/// Changes `tag` or `note`. @pre Inside a transaction.
/// @throws StoreError `tag = x (rule)` or `note = x (rule)`.
void write_annotation(const Database& database, const Annotation& annotation);

[[nodiscard]] std::vector<std::string> read_tags(const Database& database);
[[nodiscard]] std::vector<Note> read_notes(const Database& database);

}  // namespace proofmass::coordinator::detail
