#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "coordinator/query/query.hpp"
#include "coordinator/query/row_writer.hpp"

namespace proofmass::coordinator {

/// Where the answer to a query goes.
struct QueryOutput {
  RowFormat format = RowFormat::table;
  TableLimits table;
  TextSink sink;                ///< Called in this process, with whole rows of text.
  std::function<void()> flush;  ///< Called when the next rows are a while in coming.
};

/// As run_query(), but the file is opened and the query runs in a child process: whatever the file
/// and the query make SQLite do, that process is killed half a second after the time limit, or
/// after is_interrupted() has said so for half a second. Rows that it had written by then have
/// reached the sink. If the address space of this process is limited, that holds for the query and
/// its temporary data, which is kept in memory.
///
/// @pre This process has one thread.
/// @throws QueryError, TimeLimitError, StoreError, InvalidArgument; Error if the query needs more
///         memory than it may have, or its process ends by itself; and what the sink throws.
[[nodiscard]] QueryEnd run_query_in_process(const QueryFiles& files, const std::string& sql,
                                            const QueryLimits& limits, const QueryOutput& output);

}  // namespace proofmass::coordinator
