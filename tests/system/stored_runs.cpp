#include "tests/system/stored_runs.hpp"

#include <fmt/format.h>
#include <sqlite3.h>

#include <bit>

namespace proofmass::test {
namespace {

std::string column_text(sqlite3_stmt* statement, int column) {
  if (sqlite3_column_type(statement, column) == SQLITE_FLOAT) {
    return fmt::format("{:016x}",
                       std::bit_cast<std::uint64_t>(sqlite3_column_double(statement, column)));
  }
  const unsigned char* const text = sqlite3_column_text(statement, column);
  return text == nullptr ? "NULL" : reinterpret_cast<const char*>(text);
}

}  // namespace

std::map<std::int64_t, StoredRun> stored_runs(const std::filesystem::path& database) {
  std::map<std::int64_t, StoredRun> runs;
  sqlite3* connection = nullptr;
  sqlite3_stmt* statement = nullptr;
  sqlite3_open_v2(database.c_str(), &connection, SQLITE_OPEN_READONLY, nullptr);
  sqlite3_busy_timeout(connection, 5000);
  // It fails while the database is being made: then there are no runs yet.
  sqlite3_prepare_v2(connection, "SELECT * FROM run_result ORDER BY run_index", -1, &statement,
                     nullptr);
  while (statement != nullptr && sqlite3_step(statement) == SQLITE_ROW) {
    StoredRun& run = runs[sqlite3_column_int64(statement, 0)];
    for (int i = 0; i < sqlite3_column_count(statement); ++i) {
      run.push_back(column_text(statement, i));
    }
  }
  sqlite3_finalize(statement);
  sqlite3_close(connection);
  return runs;
}

std::string stored_text(const std::filesystem::path& database, const std::string& query) {
  sqlite3* connection = nullptr;
  sqlite3_stmt* statement = nullptr;
  sqlite3_open_v2(database.c_str(), &connection, SQLITE_OPEN_READONLY, nullptr);
  sqlite3_busy_timeout(connection, 5000);
  sqlite3_prepare_v2(connection, query.c_str(), -1, &statement, nullptr);
  const bool has_row = statement != nullptr && sqlite3_step(statement) == SQLITE_ROW;
  std::string text = has_row ? column_text(statement, 0) : "";
  sqlite3_finalize(statement);
  sqlite3_close(connection);
  return text;
}

std::size_t num_stored(const std::filesystem::path& database) {
  return stored_runs(database).size();
}

}  // namespace proofmass::test
