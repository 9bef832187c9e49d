#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "coordinator/query/row_writer.hpp"

namespace proofmass::coordinator {

/// What `proofmass query` is asked for.
struct QueryOptions {
  std::filesystem::path database;
  std::vector<std::string> attached;  ///< `NAME=FILE`.
  std::string sql;                    ///< `-`: to be read from standard input.
  RowFormat format = RowFormat::table;
  double timeout_s = 60.0;
  std::size_t num_rows_max = 1000;  ///< Of a table.
};

/// Answers a question in SQL on standard output.
/// @return An ExitCode; SIGINT and SIGTERM end it in order.
/// @throws QueryError, TimeLimitError, StoreError as run_query(); UsageError if standard input is
///         too long; Error if standard output takes no more.
[[nodiscard]] int query_database(const QueryOptions& options);

}  // namespace proofmass::coordinator
