#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/statistics/interval.hpp"

struct sqlite3;
struct sqlite3_stmt;

namespace proofmass::coordinator::detail {

/// How a database file is opened. `memory` opens no file, and the path is for messages only.
/// `immutable` reads the file alone, as it is, without locks and without its log. The file of
/// `read_only` cannot be changed through the connection; other databases may be attached to it.
enum class Access { create, read_write, read_only, immutable, memory };

/// How long a connection waits for the locks of others.
inline constexpr int busy_timeout_ms = 5000;

/// What of a write-ahead log goes into its file.
enum class Fold { what_no_reader_needs, all_and_empty_it };

/// @throws StoreError `campaign database = path (what)`.
[[noreturn]] void refuse_file(const std::filesystem::path& file, std::string_view what);

/// The URI of a database file with a parameter of SQLite's: `file:///a/b.db?mode=ro`.
/// @throws StoreError if the path is longer than SQLite takes.
[[nodiscard]] std::string file_uri(const std::filesystem::path& file, std::string_view parameter);

struct FinalizeStatement {
  void operator()(sqlite3_stmt* statement) const;
};

class Database;

/// A prepared statement of a Database, which outlives it. Parameters count from 1, columns from 0.
class Statement {
 public:
  /// Binds all parameters, runs to the end and resets.
  template <typename... Values>
  void run(const Values&... values) {
    bind_all(values...);
    finish();
  }

  /// Binds all parameters in order.
  template <typename... Values>
  void bind_all(const Values&... values) {
    num_bound_ = 0;
    (put(values), ...);
  }

  // Binds the next parameter after those that were put since the statement last ended.
  void put(std::int64_t value);
  /// @throws StoreError if the value is not below 2⁶³.
  void put(std::uint64_t value);
  void put(std::uint32_t value) { put(std::int64_t{value}); }
  /// A zero loses its sign: SQLite keeps none in a column of type REAL.
  /// @throws StoreError if the value is not finite; SQLite would turn NaN into NULL.
  void put(double value);
  void put(std::string_view value);
  template <typename Value>
  void put(const std::optional<Value>& value) {
    value ? put(*value) : put_null();
  }
  void put(const std::optional<Interval>& interval);  ///< Two parameters.

  /// Goes to the next row; false, and reset, after the last.
  [[nodiscard]] bool step();
  /// Goes on to the end and resets.
  void finish();

  [[nodiscard]] double real(int column) const;
  [[nodiscard]] std::optional<double> optional_real(int column) const;  ///< Empty: NULL.
  [[nodiscard]] std::int64_t integer(int column) const;
  /// @throws StoreError if the integer is negative: the file is damaged.
  [[nodiscard]] std::uint64_t count(int column) const;
  [[nodiscard]] std::optional<std::uint64_t> optional_count(int column) const;  ///< Empty: NULL.
  [[nodiscard]] std::string text(int column) const;
  /// Bounds of 95 % in a column and the next one; empty if one of them is NULL.
  [[nodiscard]] std::optional<Interval> interval(int column) const;

  /// A cell in words: numbers in the shortest text that reads back to the same bits, `NULL`.
  [[nodiscard]] std::string shown(int column) const;
  [[nodiscard]] int num_columns() const;
  [[nodiscard]] std::string column_name(int column) const;

  /// See Database::refuse_as_damaged().
  [[noreturn]] void refuse_as_damaged(std::string_view what) const;

 private:
  friend class Database;
  Statement(const Database& database, sqlite3_stmt* statement);
  void put_null();
  void check(int code) const;

  const Database* database_;
  std::unique_ptr<sqlite3_stmt, FinalizeStatement> statement_;
  int num_bound_ = 0;
};

/// One connection to one database file, for one thread.
class Database {
 public:
  /// Opens the file and waits up to 5 s, then and later, for locks of others. On a file system
  /// without locks, a file without a log is read as it is.
  /// @throws StoreError if the file cannot be opened as asked.
  Database(const std::filesystem::path& path, Access access);
  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;

  /// What the file holds comes from elsewhere: nothing in its schema may call functions with side
  /// effects, nothing changes the schema but the statements that are there for it, and what a page
  /// says of its content is checked when it is read.
  void distrust_content();

  /// Runs statements that yield nothing of interest.
  void execute(const std::string& sql);
  /// execute(); false if another connection is in the way.
  [[nodiscard]] bool execute_unless_busy(const std::string& sql);
  [[nodiscard]] Statement prepare(std::string_view sql) const;

  /// A query at its first row.
  /// @throws StoreError if there is none: the file is damaged.
  [[nodiscard]] Statement first_row(std::string_view sql) const;
  /// First column of that row.
  [[nodiscard]] std::int64_t integer(std::string_view sql) const;
  [[nodiscard]] std::uint64_t count(std::string_view sql) const;  ///< As Statement::count().
  [[nodiscard]] std::string text(std::string_view sql) const;

  /// Rows changed by the last INSERT, UPDATE or DELETE.
  [[nodiscard]] std::int64_t num_changes() const;
  /// Key of the row that was inserted last.
  [[nodiscard]] std::int64_t last_row() const;
  [[nodiscard]] bool in_transaction() const;

  /// Replaces the content of another database by that of this one, as it is now.
  /// @param on_part  Called before each of the parts that are copied; what it throws is passed on.
  /// @throws StoreError naming this file if it is damaged, and else the copy.
  void copy_to(Database& copy, const std::function<void()>& on_part);

  /// Goes on with a copy of its own that may be changed: SQLite keeps it in memory while it is
  /// small, and else in a nameless file of the temporary directory, which ends with the process,
  /// however that ends. Messages still name the file. @pre No statement is under way.
  /// @throws StoreError if the copy cannot be made, for want of space for instance.
  void go_on_with_private_copy();

  /// Makes the tables of another database known under `name.`: those of its file, which can only be
  /// read, or a copy of its private copy. @pre The other was opened read-only.
  /// @throws StoreError naming that file.
  void attach(const Database& other, const std::string& name);

  /// The connection, for what SQLite can do and this class cannot.
  [[nodiscard]] sqlite3* handle() const { return connection_.get(); }

  /// Bytes of the write-ahead log; 0 if there is none.
  [[nodiscard]] std::uint64_t log_size() const;

  void wait_as_usual();  ///< Up to 5 s for locks of others.

  /// Copies the write-ahead log into the file. True if all of it is there now and, if so asked, the
  /// log is empty; false if somebody reads an older state, or writes.
  [[nodiscard]] bool fold_log(Fold fold);

  /// Whether the last connection copies the log into the file and removes it when it is closed, as
  /// usual. Otherwise the file is not touched any more then, and its log stays: for a file that has
  /// lost its name, for one that says that it needs its log, and for one that has not been checked.
  void fold_log_at_close(bool is_folded);

  /// From now on messages name another file: that of which this one is a copy.
  void name_in_messages(const std::filesystem::path& file) { path_ = file; }

  /// @throws StoreError `campaign database = path (what)`.
  [[noreturn]] void refuse(std::string_view what) const;

  /// @throws StoreError `campaign database = path (is damaged: what; restore it from a copy)`, or
  /// with the remedy for a log that is not that of the file.
  [[noreturn]] void refuse_as_damaged(std::string_view what) const;

  /// @throws StoreError `campaign database = path (what went wrong, with a remedy)`.
  [[noreturn]] void fail(int code) const;

 private:
  friend class StepLimit;
  struct Close {
    void operator()(sqlite3* connection) const;
  };

  void open(Access access);
  [[noreturn]] void refuse_copy(int code) const;

  std::filesystem::path path_;
  std::string name_;      ///< By which SQLite opened it.
  bool had_log_ = false;  ///< When it was opened: the log may be another file's.
  std::unique_ptr<sqlite3, Close> connection_;
  bool is_private_copy_ = false;
};

/// Changes that are stored together by commit(), or not at all.
class Transaction {
 public:
  explicit Transaction(Database& database);
  ~Transaction();
  Transaction(const Transaction&) = delete;
  Transaction& operator=(const Transaction&) = delete;

  /// Durable when it returns.
  void commit();

 private:
  Database& database_;
};

/// While it lives, all that is read is of one state of the file, whatever others write meanwhile.
/// In a transaction that is under way it adds nothing.
class ReadTransaction {
 public:
  explicit ReadTransaction(Database& database);
  ~ReadTransaction();
  ReadTransaction(const ReadTransaction&) = delete;
  ReadTransaction& operator=(const ReadTransaction&) = delete;

 private:
  Database& database_;
  bool is_within_another_;
};

/// While it lives, a statement fails that takes more than so many steps of SQLite's machine.
class StepLimit {
 public:
  StepLimit(const Database& database, int num_steps);
  ~StepLimit();
  StepLimit(const StepLimit&) = delete;
  StepLimit& operator=(const StepLimit&) = delete;

 private:
  const Database& database_;
};

/// What `make` makes of each row of a query.
/// @param values  Of the parameters of the query, in order.
template <typename Make, typename... Values>
[[nodiscard]] auto rows_of(const Database& database, std::string_view sql, const Make& make,
                           const Values&... values) {
  Statement row = database.prepare(sql);
  row.bind_all(values...);
  std::vector<decltype(make(row))> rows;
  while (row.step()) rows.push_back(make(row));
  return rows;
}

/// A cell that becomes what it initialises: a number, a text or an identifier.
struct Cell {
  const Statement& row;
  int column;

  template <typename Value>
  operator Value() const {  // NOLINT: a member of a struct takes it as its value.
    if constexpr (std::same_as<Value, std::string>) {
      return row.text(column);
    } else if constexpr (std::same_as<Value, double>) {
      return row.real(column);
    } else if constexpr (std::is_integral_v<Value>) {
      return static_cast<Value>(row.count(column));
    } else {
      return {static_cast<decltype(Value::value)>(row.count(column))};
    }
  }
};

/// rows_of() a query whose columns are the first members of a struct, in their order.
template <typename Row, std::size_t num_columns, typename... Values>
[[nodiscard]] std::vector<Row> structs_of(const Database& database, std::string_view sql,
                                          const Values&... values) {
  const auto make = [](const Statement& row) {
    return [&]<int... columns>(std::integer_sequence<int, columns...>) {
      return Row{Cell{row, columns}...};
    }
    (std::make_integer_sequence<int, num_columns>());
  };
  return rows_of(database, sql, make, values...);
}

/// `?, ?, ?`: places for so many values in a statement.
[[nodiscard]] std::string places(int count);

}  // namespace proofmass::coordinator::detail
