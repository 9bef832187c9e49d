#include "tests/fuzz/file_mutator.hpp"

#include <fmt/format.h>
#include <sqlite3.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <iterator>
#include <utility>

namespace proofmass::test {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t page_size = 4096;

std::string read_bytes(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// The first column of a query's rows; what fails yields nothing.
std::vector<std::string> texts(sqlite3* database, const std::string& sql) {
  std::vector<std::string> found;
  sqlite3_stmt* statement = nullptr;
  sqlite3_prepare_v2(database, sql.c_str(), -1, &statement, nullptr);
  while (statement != nullptr && sqlite3_step(statement) == SQLITE_ROW) {
    const auto* const text = sqlite3_column_text(statement, 0);
    if (text != nullptr) found.emplace_back(reinterpret_cast<const char*>(text));
  }
  sqlite3_finalize(statement);
  return found;
}

}  // namespace

void FileMutator::make(const std::vector<fs::path>& originals, const fs::path& file) {
  for (const char* const suffix : {"", "-wal", "-shm", "-journal", ".lock"}) {
    fs::remove_all(fs::path(file) += suffix);
  }
  std::string bytes = read_bytes(originals[below(originals.size())]);
  const std::size_t kind = below(10);
  if (kind < 3) change_bytes(bytes);
  if (kind == 3) change_page(bytes);
  if (kind == 4) bytes.resize(below(bytes.size() + page_size));
  std::ofstream(file, std::ios::binary) << bytes;
  if (kind >= 5) change_rows(file);
  if (kind == 9) {
    bytes = read_bytes(file);
    change_bytes(bytes);
    std::ofstream(file, std::ios::binary) << bytes;
  }
}

std::string FileMutator::changed_text(std::string text) {
  static constexpr std::array<const char*, 22> words{
      "nan",  "inf",      "-1",   "1e999", "9223372036854775808",
      "0x7f", "\"",       "[",    "]]",    "=",
      "true", "\xff\xfe", "\r\n", "#",     "''",
      "1_0",  "\t",       ",",    "..",    "\x1b[2J",
      "e",    "{}"};
  const std::size_t num_changes = 1 + below(3);
  for (std::size_t i = 0; i < num_changes; ++i) {
    const std::size_t at = below(text.size() + 1);
    const std::size_t line = std::min(text.find('\n', at), text.size());
    switch (below(6)) {
      case 0:
        if (at < text.size()) text[at] = static_cast<char>(below(256));
        break;
      case 1:
        text.erase(at, 1 + below(3));
        break;
      case 2:
        text.insert(at, words[below(words.size())]);
        break;
      case 3:  // The rest of a line.
        text.replace(at, line - at, words[below(words.size())]);
        break;
      case 4:  // A part of it twice.
        text.insert(at, text.substr(below(text.size() + 1), below(60)));
        break;
      default:
        if (below(4) == 0) text.resize(at);
        break;
    }
  }
  return text;
}

void FileMutator::change_bytes(std::string& bytes) {
  const std::size_t num_changes = 1 + below(6);
  for (std::size_t i = 0; i < num_changes; ++i) {
    // A third of them in the file's header or at the head of a page.
    std::size_t at = below(bytes.size());
    if (below(6) == 0) at = below(100);
    if (below(6) == 0) at = below(bytes.size() / page_size) * page_size + below(64);
    switch (below(3)) {
      case 0:
        bytes[at] = static_cast<char>(bytes[at] ^ 1 << below(8));
        break;
      case 1:
        bytes[at] = static_cast<char>(below(256));
        break;
      default:
        bytes[at] = below(2) == 0 ? '\0' : '\xff';
        break;
    }
  }
}

void FileMutator::change_page(std::string& bytes) {
  const std::size_t num_pages = bytes.size() / page_size;
  const std::size_t from = below(num_pages) * page_size;
  const std::size_t to = below(num_pages) * page_size;
  switch (below(3)) {
    case 0:
      std::swap_ranges(bytes.begin() + static_cast<std::ptrdiff_t>(from),
                       bytes.begin() + static_cast<std::ptrdiff_t>(from + page_size),
                       bytes.begin() + static_cast<std::ptrdiff_t>(to));
      break;
    case 1:
      bytes.replace(to, page_size, bytes.substr(from, page_size));
      break;
    default:
      bytes.replace(to, page_size, std::string(page_size, below(2) == 0 ? '\0' : '\xa5'));
      break;
  }
}

void FileMutator::change_rows(const fs::path& file) {
  sqlite3* database = nullptr;
  sqlite3_open(file.c_str(), &database);
  const auto execute = [&](const std::string& sql) {
    sqlite3_exec(database, sql.c_str(), nullptr, nullptr, nullptr);
  };
  execute(
      "PRAGMA journal_mode = MEMORY; PRAGMA synchronous = OFF; PRAGMA foreign_keys = OFF;"
      "PRAGMA ignore_check_constraints = ON; PRAGMA writable_schema = ON;");
  const std::vector<std::string> tables = texts(
      database, "SELECT name FROM sqlite_schema WHERE type = 'table' AND name NOT LIKE 'sqlite%'");
  const std::size_t num_changes = 1 + below(3);
  for (std::size_t i = 0; i < num_changes && !tables.empty(); ++i) {
    const std::string table = below(3) == 0   ? "run_result"
                              : below(4) == 0 ? "campaign"
                                              : tables[below(tables.size())];
    const auto columns = texts(database, "SELECT name FROM pragma_table_info('" + table + "')");
    if (columns.empty()) continue;
    const std::string& column = columns[below(columns.size())];
    const std::string where = fmt::format("WHERE {0} = (SELECT {0} FROM {1} LIMIT 1 OFFSET {2})",
                                          columns[0], table, below(1 + below(20)));
    const std::size_t kind = below(10);
    if (kind < 6) {
      execute(fmt::format("UPDATE OR REPLACE {} SET {} = {} {}", table, column, value(), where));
    } else if (kind == 6) {
      execute(fmt::format("DELETE FROM {} {}", table, below(4) == 0 ? "" : where));
    } else if (kind == 7) {
      execute(
          fmt::format("CREATE TEMP TABLE t AS SELECT * FROM {0} LIMIT 1; UPDATE t SET {1} = {2};"
                      "INSERT OR REPLACE INTO {0} SELECT * FROM t; DROP TABLE t",
                      table, columns[0], value()));
    } else {
      execute(change_of_schema(table));
    }
  }
  if (below(2) == 0) execute("PRAGMA journal_mode = WAL");
  sqlite3_close(database);
}

std::string FileMutator::change_of_schema(const std::string& table) {
  const auto edited = [&](const std::string& from, const std::string& to) {
    return fmt::format("UPDATE sqlite_schema SET sql = replace(sql, '{}', '{}') WHERE name = '{}'",
                       from, to, table);
  };
  switch (below(14)) {
    case 0:
      return "DROP TABLE " + table;
    case 1:
      return fmt::format("CREATE TRIGGER x AFTER UPDATE ON {} BEGIN DELETE FROM campaign; END",
                         table);
    case 2:
      return fmt::format("ALTER TABLE {0} RENAME TO y; CREATE VIEW {0} AS SELECT * FROM y", table);
    case 3:  // A view without an end in place of a table.
      return fmt::format(
          "ALTER TABLE {0} RENAME TO y; CREATE VIEW {0} AS WITH RECURSIVE n(i) AS (SELECT 1 UNION "
          "ALL SELECT i + 1 FROM n) SELECT y.* FROM y, n WHERE n.i < 0",
          table);
    case 4:
      return fmt::format("ALTER TABLE {} ADD COLUMN more TEXT", table);
    case 5:
      return fmt::format("PRAGMA user_version = {}", below(9));
    case 6:
      return fmt::format("PRAGMA application_id = {}", below(9));
    case 7:
      return edited("STRICT", "");
    case 8:
      return edited("WITHOUT ROWID", "");
    case 9:
      return edited("REAL", "BLOB");
    case 10:
      return edited("INTEGER", "TEXT");
    case 11:
      return edited("CREATE TABLE", "CREATE VIEW");
    case 12:
      return fmt::format("UPDATE sqlite_schema SET rootpage = {} WHERE name = '{}'", below(60),
                         table);
    default:
      return fmt::format("PRAGMA encoding = 'UTF-16'; CREATE INDEX more ON {} (1)", table);
  }
}

std::string FileMutator::value() {
  static constexpr std::array<const char*, 34> values{"NULL",
                                                      "0",
                                                      "-1",
                                                      "1",
                                                      "2",
                                                      "19",
                                                      "20",
                                                      "21",
                                                      "1000",
                                                      "4294967295",
                                                      "4294967296",
                                                      "9223372036854775807",
                                                      "-9223372036854775808",
                                                      "1e308",
                                                      "-1e308",
                                                      "9e999",
                                                      "-9e999",
                                                      "1e-320",
                                                      "-0.0",
                                                      "0.5",
                                                      "1e90",
                                                      "1.1e90",
                                                      "''",
                                                      "'x'",
                                                      "char(27) || '[2J' || char(7)",
                                                      "'active'",
                                                      "'finished'",
                                                      "x'00ff80'",
                                                      "CAST(x'ff80fe' AS TEXT)",
                                                      "char(0)",
                                                      "hex(zeroblob(5000))",
                                                      "zeroblob(200000)",
                                                      "'2024-02-29T12:00:10Z'",
                                                      "'1e999'"};
  if (below(4) == 0) return std::to_string(random_());
  return values[below(values.size())];
}

}  // namespace proofmass::test
