#pragma once

#include <memory>

#include "coordinator/query/query.hpp"

struct sqlite3;

namespace proofmass::coordinator {

struct CloseConnection {
  void operator()(sqlite3* connection) const;
};
using Connection = std::unique_ptr<sqlite3, CloseConnection>;

/// A connection to campaign databases that cannot write to them; each is checked first. Of a file
/// of an older version it has a private copy, brought up to date.
/// @throws StoreError if a file is none of a campaign or cannot be read.
[[nodiscard]] Connection open_files(const QueryFiles& files);

}  // namespace proofmass::coordinator
