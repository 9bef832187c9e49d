#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "coordinator/query/row_writer.hpp"
#include "core/error.hpp"

namespace proofmass::coordinator {

/// A query is wrong or asks for more than reading; reads
/// `sql = SELECT x FROM event (no such column: x, at line 1, character 8)`.
class QueryError : public InvalidArgument {
 public:
  using InvalidArgument::InvalidArgument;
};

/// Another campaign database, whose tables a query finds under `name.`.
struct AttachedFile {
  std::string name;  ///< Letters, digits and _, no digit first; neither main nor temp.
  std::filesystem::path file;
};

/// Most files that one query attaches; SQLite has no room for more.
inline constexpr std::size_t attached_files_max = 10;

struct QueryFiles {
  QueryFiles(std::filesystem::path main_file, std::vector<AttachedFile> attached_files = {})
      : main(std::move(main_file)), attached(std::move(attached_files)) {}

  std::filesystem::path main;
  std::vector<AttachedFile> attached;  ///< With different names.
};

/// Where a query keeps what it sorts and collects.
enum class TemporaryData : std::uint8_t {
  in_files,   ///< From some size on; in the directory that SQLITE_TMPDIR or TMPDIR names.
  in_memory,  ///< Within the memory that the query may have.
};

struct QueryLimits {
  std::chrono::duration<double> time_limit{60.0};  ///< With the opening of the file.
  /// Bytes; held by run_bounded_query().
  std::uint64_t memory_size_max = std::uint64_t{8} << 30;
  TemporaryData temporary_data = TemporaryData::in_files;
  /// Asked every few microseconds; the query ends when it says so.
  std::function<bool()> is_interrupted = [] { return false; };
};

/// What is said of a query that took too long: `timeout = 60 (...)`.
[[nodiscard]] std::string time_limit_text(const QueryLimits& limits);
/// What is said of a query that needs more memory: `memory = 8192 MiB (the query needs more; ...)`.
[[nodiscard]] std::string memory_limit_text(const QueryLimits& limits);

enum class QueryEnd : std::uint8_t { complete, interrupted };

/// Longest query that is read, bytes.
inline constexpr std::size_t sql_size_max = 1'000'000;

/// Asks one question of campaign databases, also while coordinators write to them. The statement
/// may read, and nothing else; it sees each file as it was when it began.
///
/// @param writer  Has got part of the rows if an exception comes after begin().
/// The limits are looked at between steps of the query; see run_bounded_query() for calls that
/// do not end.
/// @throws QueryError; StoreError if the file cannot be read; Error if time or memory is lacking;
///         and what the writer throws.
[[nodiscard]] QueryEnd run_query(const QueryFiles& files, const std::string& sql,
                                 const QueryLimits& limits, RowWriter& writer);

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
