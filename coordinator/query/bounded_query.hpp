#pragma once

#include <functional>
#include <string>
#include <string_view>

#include "coordinator/query/query.hpp"
#include "coordinator/query/row_writer.hpp"

namespace proofmass::coordinator {

/// Where the answer to a query goes.
struct QueryOutput {
  RowFormat format = RowFormat::table;
  TableLimits table;
  /// Called with whole rows of text, from one thread at a time. It has passed them on when it
  /// returns.
  TextSink sink;
  /// Called in place of an exception or an end when a query cannot be ended in order. Must end the
  /// process: what SQLite is doing goes on until then.
  /// @param error  What the exception would say; empty for a query that was interrupted.
  std::function<void(const std::string& error)> end_process;
};

/// As run_query(), for a process that has nothing else to do: whatever the file and the query make
/// SQLite do, the process ends half a second after the time limit, or after is_interrupted() has
/// said so for half a second. Rows that the query has returned by then have reached the sink.
///
/// Lowers the address space of the process, for good. If it was limited before, that holds for the
/// query and its temporary data, which is kept in memory.
/// @throws As run_query(), and what the sink throws.
[[nodiscard]] QueryEnd run_bounded_query(const QueryFiles& files, const std::string& sql,
                                         const QueryLimits& limits, const QueryOutput& output);

}  // namespace proofmass::coordinator
