#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "coordinator/store/detail/database.hpp"

namespace proofmass::coordinator::detail {

/// What is compared of a table.
struct ComparedTable {
  std::string_view name;
  std::string_view row_name;       ///< An SQL expression that no two rows share: `parameter`.
  std::string_view columns = "*";  ///< All of them, or `a, b`.
};

/// Rows that are not expected.
enum class FurtherRows : std::uint8_t { refuse, ignore };

/// What tables have other than they would have in a new file, a line each: `statistic lacks k2d`,
/// `statistic.mean of k2d = 1 (must be 25.5)`. Numbers are equal if their bits are.
///
/// @param write  Writes to a new file in memory what is expected. The same functions as those that
/// write to a campaign database: nothing is said twice of what a table holds.
[[nodiscard]] std::vector<std::string> table_differences(
    const Database& database, const std::function<void(Database&)>& write,
    std::span<const ComparedTable> tables, FurtherRows further = FurtherRows::refuse);

}  // namespace proofmass::coordinator::detail
