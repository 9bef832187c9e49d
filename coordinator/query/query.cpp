#include "coordinator/query/query.hpp"

#include <fmt/format.h>
#include <sqlite3.h>

#include <algorithm>
#include <array>
#include <memory>
#include <utility>
#include <vector>

#include "coordinator/query/aggregates.hpp"
#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/detail/store_impl.hpp"
#include "coordinator/store/records.hpp"
#include "coordinator/table/table.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::size_t shown_sql_width = 60;
// So often, counted in steps of SQLite's machine, somebody looks at the clock; a row of draw()
// takes a few steps, and 10 ms in the worst case.
constexpr int steps_between_looks = 100;

using Statement = std::unique_ptr<sqlite3_stmt, detail::FinalizeStatement>;

// One line of the query, that of the position if there is one.
std::string shown_sql(std::string_view sql, std::size_t position) {
  const std::string_view before = sql.substr(0, position);
  const std::size_t begin = before.rfind('\n') + 1;  // 0 without one.
  const std::size_t end = std::min(sql.find('\n', position), sql.size());
  return shortened(wire::visible_text(sql.substr(begin, end - begin)), shown_sql_width);
}

std::string place_text(std::string_view sql, std::size_t position) {
  const std::string_view before = sql.substr(0, position);
  const auto line = std::ranges::count(before, '\n') + 1;
  const std::string_view in_line = before.substr(before.rfind('\n') + 1);
  const auto starts = [](char c) { return (static_cast<unsigned char>(c) & 0xc0U) != 0x80U; };
  return fmt::format("line {}, character {}", line, std::ranges::count_if(in_line, starts) + 1);
}

[[noreturn]] void refuse(std::string_view sql, std::string_view reason) {
  throw QueryError(
      fmt::format("sql = {} ({})", shown_sql(sql, sql.find_first_not_of(" \t\r\n")), reason));
}

// Tables that are computed belong to no database: `b.draw` would be that of another one.
std::string with_remedy(std::string text) {
  constexpr std::string_view missing = "no such table: ";
  if (!text.starts_with(missing)) return text;
  for (const std::string_view table : {"draw", "definition_entry"}) {
    const std::string end = fmt::format(".{}", table);
    if (!text.ends_with(end)) continue;
    const std::string database =
        text.substr(missing.size(), text.size() - missing.size() - end.size());
    return text +
           fmt::format("; name the database in the argument, as in {}('{}')", table, database);
  }
  return text;
}

// They tell something of the file and change nothing, whatever their argument.
constexpr std::array<const char*, 16> telling_pragmas{
    "collation_list",   "compile_options", "database_list", "foreign_key_check",
    "foreign_key_list", "function_list",   "index_info",    "index_list",
    "index_xinfo",      "integrity_check", "module_list",   "pragma_list",
    "quick_check",      "table_info",      "table_list",    "table_xinfo"};
// They tell something without an argument, and change it with one.
constexpr std::array<const char*, 8> pragmas_of_state{"application_id", "data_version", "encoding",
                                                      "freelist_count", "page_count",   "page_size",
                                                      "schema_version", "user_version"};
// The first loads machine code from a file, the second calls what an address points to.
constexpr std::array<const char*, 2> dangerous_functions{"load_extension", "fts3_tokenizer"};

/// Names of SQLite have no case.
template <typename Names>
bool contains(const Names& names, const char* name) {
  return std::ranges::any_of(names,
                             [&](const char* known) { return sqlite3_stricmp(known, name) == 0; });
}

bool is_harmless_pragma(const char* name, bool has_argument) {
  return contains(telling_pragmas, name) || (!has_argument && contains(pragmas_of_state, name));
}

/// Why a statement may not do something, for people; empty if it may: it reads and does nothing
/// else, and calls no function or PRAGMA that is not harmless.
std::string refusal_of(int action, const char* first, const char* second) {
  switch (action) {
    case SQLITE_SELECT:
    case SQLITE_READ:
    case SQLITE_RECURSIVE:
      return {};
    case SQLITE_UPDATE:
      // SQLite asks so when a table-valued function is first named, and writes nothing. A statement
      // that would is known by sqlite3_stmt_readonly(), and the connection is read-only.
      if (std::string_view(first) == "sqlite_master") return {};
      return "only reading is allowed";
    case SQLITE_FUNCTION:
      if (!contains(dangerous_functions, second)) return {};
      return fmt::format("the function {} is not allowed", second);
    case SQLITE_PRAGMA:
      if (is_harmless_pragma(first, second != nullptr && *second != '\0')) return {};
      return fmt::format(
          "PRAGMA {} {}", first,
          is_harmless_pragma(first, false) ? "may be read, not set" : "is not allowed");
    default:
      return "only reading is allowed";
  }
}

/// A connection to campaign databases that cannot write to them; each is checked first. Of a file
/// of an older version it has a private copy, brought up to date.
/// @throws StoreError if a file is no campaign database or cannot be read.
std::unique_ptr<detail::Database> open_files(const QueryFiles& files) {
  PROOFMASS_EXPECT(files.attached.size() <= attached_files_max);
  detail::check_presence(files.main);
  auto database = std::make_unique<detail::Database>(files.main, detail::Access::read_only);
  (void)detail::prepare_reader(*database, files.main);
  for (const auto& [name, file] : files.attached) {
    detail::check_presence(file);
    detail::Database other(file, detail::Access::read_only);
    (void)detail::prepare_reader(other, file);
    database->attach(other, name);
  }
  // A private copy has it on: the caller has tables of its own to add before it is turned on again.
  database->execute("PRAGMA query_only = OFF");
  return database;
}

/// A read-only connection on which nothing but reading is possible, for some time.
class Reader {
 public:
  Reader(const QueryFiles& files, const QueryLimits& limits, Clock::time_point end);

  /// @throws QueryError unless the text is one statement that reads.
  [[nodiscard]] Statement prepare(const std::string& sql);
  /// @returns False after the last row or if the query was interrupted.
  [[nodiscard]] bool step(sqlite3_stmt* statement, const std::string& sql);
  [[nodiscard]] bool is_interrupted() const { return is_interrupted_; }

 private:
  [[nodiscard]] sqlite3* connection() const { return database_->handle(); }
  void restrict_connection();
  void set_limits();
  static int on_progress(void* reader);
  static int on_action(void* reader, int action, const char* first, const char* second, const char*,
                       const char*);
  void check(int code) const;
  [[noreturn]] void fail(int code, const std::string& sql) const;
  [[noreturn]] void fail_query(const std::string& sql) const;
  void require_one_statement(const std::string& sql, const char* rest);

  std::string files_text_;  ///< Their names, for messages.
  QueryLimits limits_;
  Clock::time_point end_;
  bool is_late_ = false;
  bool is_interrupted_ = false;
  std::string refusal_;  ///< The first thing that was refused; empty if nothing was.
  std::unique_ptr<detail::Database> database_;
};

std::string text_of(const QueryFiles& files) {
  std::string text = files.main.string();
  for (const AttachedFile& attached : files.attached) text += " or " + attached.file.string();
  return text;
}

Reader::Reader(const QueryFiles& files, const QueryLimits& limits, Clock::time_point end)
    : files_text_(text_of(files)), limits_(limits), end_(end), database_(open_files(files)) {
  // This deletes all temporary tables, of which the functions bring some.
  if (limits_.temporary_data == TemporaryData::in_memory) {
    database_->execute("PRAGMA temp_store = MEMORY");
  }
  check(register_functions(connection()));
  set_limits();
  restrict_connection();
}

// Beside what holds for every reader, see detail::configure(). Text in double quotes is a name and
// never a value.
void Reader::restrict_connection() {
  constexpr std::array<std::pair<int, int>, 3> settings{{{SQLITE_DBCONFIG_ENABLE_LOAD_EXTENSION, 0},
                                                         {SQLITE_DBCONFIG_ENABLE_FTS3_TOKENIZER, 0},
                                                         {SQLITE_DBCONFIG_DQS_DML, 0}}};
  for (const auto& [setting, value] : settings) {
    check(sqlite3_db_config(connection(), setting, value, nullptr));
  }
  database_->execute("PRAGMA query_only = ON");
  sqlite3_set_authorizer(connection(), &Reader::on_action, this);
  sqlite3_progress_handler(connection(), steps_between_looks, &Reader::on_progress, this);
}

void Reader::set_limits() {
  constexpr std::array<std::pair<int, int>, 8> bounds{
      {{SQLITE_LIMIT_LENGTH, 64 << 20},
       {SQLITE_LIMIT_SQL_LENGTH, static_cast<int>(sql_size_max)},
       {SQLITE_LIMIT_COLUMN, 1000},
       {SQLITE_LIMIT_EXPR_DEPTH, 500},
       {SQLITE_LIMIT_COMPOUND_SELECT, 100},
       {SQLITE_LIMIT_LIKE_PATTERN_LENGTH, 1000},
       {SQLITE_LIMIT_ATTACHED, 0},
       {SQLITE_LIMIT_WORKER_THREADS, 0}}};
  for (const auto& [limit, value] : bounds) sqlite3_limit(connection(), limit, value);
}

int Reader::on_progress(void* self) {
  auto& reader = *static_cast<Reader*>(self);
  reader.is_interrupted_ = reader.is_interrupted_ || reader.limits_.is_interrupted();
  reader.is_late_ = reader.is_late_ || Clock::now() >= reader.end_;
  return reader.is_interrupted_ || reader.is_late_ ? 1 : 0;
}

int Reader::on_action(void* self, int action, const char* first, const char* second, const char*,
                      const char*) {
  const std::string refusal = refusal_of(action, first, second);
  if (refusal.empty()) return SQLITE_OK;
  auto& reader = *static_cast<Reader*>(self);
  if (reader.refusal_.empty()) reader.refusal_ = refusal;
  return SQLITE_DENY;
}

void Reader::check(int code) const {
  if (code != SQLITE_OK) fail(code, {});
}

// What the file is to blame for, what the time, and what the query.
void Reader::fail(int code, const std::string& sql) const {
  if (!refusal_.empty()) refuse(sql, refusal_);
  const char* text = sqlite3_errmsg(connection());
  switch (code & 0xff) {
    case SQLITE_INTERRUPT:
      throw Error(time_limit_text(limits_));
    case SQLITE_NOMEM:
      throw Error(memory_limit_text(limits_));
    case SQLITE_FULL:  // Nothing else is written.
      throw Error(
          "there is no space left for temporary files; set SQLITE_TMPDIR to a directory with more, "
          "or "
          "ask for less");
    case SQLITE_ERROR:
    case SQLITE_AUTH:
    case SQLITE_TOOBIG:
    case SQLITE_MISMATCH:
    case SQLITE_RANGE:
    case SQLITE_READONLY:
    case SQLITE_SCHEMA:  // What a query without FROM gets for an unknown name.
      fail_query(sql);
    case SQLITE_CORRUPT:
      throw StoreError(fmt::format(
          "campaign database = {} (is damaged: {}; restore it from a copy)", files_text_, text));
    default:
      throw StoreError(fmt::format("campaign database = {} ({})", files_text_, text));
  }
}

void Reader::fail_query(const std::string& sql) const {
  const std::string text = with_remedy(sqlite3_errmsg(connection()));
  const int offset = sqlite3_error_offset(connection());
  if (offset < 0) refuse(sql, text);
  const auto position = static_cast<std::size_t>(offset);
  throw QueryError(fmt::format("sql = {} ({}, at {})", shown_sql(sql, position), text,
                               place_text(sql, position)));
}

Statement Reader::prepare(const std::string& sql) {
  if (sql.size() > sql_size_max) {
    refuse(sql, fmt::format("must be at most {} bytes", sql_size_max));
  }
  if (sql.find('\0') != std::string::npos) refuse(sql, "must not hold a zero byte");
  sqlite3_stmt* statement = nullptr;
  const char* rest = nullptr;
  const int code = sqlite3_prepare_v2(connection(), sql.c_str(), -1, &statement, &rest);
  Statement prepared(statement);
  if (code != SQLITE_OK) fail(code, sql);
  if (!prepared) refuse(sql, "holds no statement");
  require_one_statement(sql, rest);
  if (sqlite3_stmt_readonly(statement) == 0) refuse(sql, "only reading is allowed");
  if (sqlite3_bind_parameter_count(statement) > 0) {
    refuse(sql, "has a parameter such as ?, :name or $name, which nothing gives a value");
  }
  return prepared;
}

// Blanks, comments and semicolons are no statement.
void Reader::require_one_statement(const std::string& sql, const char* rest) {
  while (*rest != '\0') {
    sqlite3_stmt* statement = nullptr;
    const char* begin = rest;
    const int code = sqlite3_prepare_v2(connection(), begin, -1, &statement, &rest);
    const Statement prepared(statement);
    if (code == SQLITE_OK && !prepared) continue;
    const auto position = static_cast<std::size_t>(begin - sql.c_str());
    const std::size_t start = std::min(sql.find_first_not_of(" \t\r\n;", position), sql.size());
    throw QueryError(fmt::format("sql = {} (must be one statement, another begins at {})",
                                 shown_sql(sql, start), place_text(sql, start)));
  }
}

bool Reader::step(sqlite3_stmt* statement, const std::string& sql) {
  const int code = sqlite3_step(statement);
  if (code == SQLITE_ROW) return true;
  if (code == SQLITE_DONE || is_interrupted_) return false;
  fail(code, sql);
}

Value cell_of(sqlite3_stmt* statement, int column) {
  const auto size = [&] {
    return static_cast<std::size_t>(sqlite3_column_bytes(statement, column));
  };
  switch (sqlite3_column_type(statement, column)) {
    case SQLITE_INTEGER:
      return std::int64_t{sqlite3_column_int64(statement, column)};
    case SQLITE_FLOAT:
      return sqlite3_column_double(statement, column);
    case SQLITE_TEXT: {
      const auto* text = reinterpret_cast<const char*>(sqlite3_column_text(statement, column));
      return std::string_view(text, size());
    }
    case SQLITE_BLOB: {
      const auto* bytes = static_cast<const char*>(sqlite3_column_blob(statement, column));
      return Blob{std::string_view(bytes, size())};
    }
    default:
      return std::monostate();
  }
}

std::vector<std::string> column_names(sqlite3_stmt* statement) {
  std::vector<std::string> names;
  for (int i = 0; i < sqlite3_column_count(statement); ++i) {
    const char* name = sqlite3_column_name(statement, i);
    names.emplace_back(name == nullptr ? "" : name);
  }
  return names;
}

}  // namespace

std::string time_limit_text(const QueryLimits& limits) {
  return fmt::format("timeout = {} (the query did not end in so many seconds)",
                     limits.time_limit.count());
}

std::string memory_limit_text(const QueryLimits& limits) {
  const bool has_all_in_it = limits.temporary_data == TemporaryData::in_memory;
  return fmt::format("memory = {} MiB (the query{} more; ask for less{})",
                     limits.memory_size_max >> 20,
                     has_all_in_it ? " and what it sorts need" : " needs",
                     has_all_in_it ? ", or query a copy of the database elsewhere" : "");
}

QueryEnd run_query(const QueryFiles& files, const std::string& sql, const QueryLimits& limits,
                   RowWriter& writer) {
  const Clock::time_point end =
      Clock::now() + std::chrono::duration_cast<Clock::duration>(limits.time_limit);
  Reader reader(files, limits, end);
  const Statement statement = reader.prepare(sql);
  const std::vector<std::string> names = column_names(statement.get());
  writer.begin(names);
  std::vector<Value> cells(names.size());
  while (reader.step(statement.get(), sql)) {
    for (std::size_t i = 0; i < cells.size(); ++i) {
      cells[i] = cell_of(statement.get(), static_cast<int>(i));
    }
    if (!writer.row(cells)) break;
  }
  if (reader.is_interrupted()) return QueryEnd::interrupted;
  writer.end();
  return QueryEnd::complete;
}

}  // namespace proofmass::coordinator
