#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace proofmass::test {

/// Every column of a row of run_result, numbers as the bits of their doubles.
using StoredRun = std::vector<std::string>;

/// The rows of run_result by run index; empty if the database is not there yet.
[[nodiscard]] std::map<std::int64_t, StoredRun> stored_runs(const std::filesystem::path& database);

/// Number of those rows.
[[nodiscard]] std::size_t num_stored(const std::filesystem::path& database);

/// The first value that a query gives; empty if there is none.
[[nodiscard]] std::string stored_text(const std::filesystem::path& database,
                                      const std::string& query);

}  // namespace proofmass::test
