#include <fmt/format.h>
#include <sqlite3ext.h>

#include <algorithm>
#include <cstddef>
#include <exception>
#include <new>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/query/virtual_table-inl.hpp"
#include "core/error.hpp"
#include "core/model.hpp"
#include "proto/model_program/described_model.hpp"

SQLITE_EXTENSION_INIT3

namespace proofmass::coordinator {
namespace {

/// A statement that reads a database of a connection. The store has a larger class of the kind, but
/// that is bound to the SQLite of our own programs, and the extension must use the one that loads
/// it.
class Selection {
 public:
  Selection(sqlite3* connection, std::string_view sql) : connection_(connection) {
    sqlite3_stmt* statement = nullptr;
    check(sqlite3_prepare_v2(connection, sql.data(), static_cast<int>(sql.size()), &statement,
                             nullptr));
    statement_.reset(statement);
  }

  void bind(const std::string& text) {
    check(sqlite3_bind_text(statement_.get(), 1, text.c_str(), -1, SQLITE_TRANSIENT));
  }
  [[nodiscard]] bool step() {
    const int code = sqlite3_step(statement_.get());
    if (code != SQLITE_ROW && code != SQLITE_DONE) check(code);
    return code == SQLITE_ROW;
  }
  void require_row() {
    if (!step()) throw Error("the database holds no campaign");
  }

  [[nodiscard]] double real(int column) const {
    return sqlite3_column_double(statement_.get(), column);
  }
  [[nodiscard]] std::int64_t integer(int column) const {
    return sqlite3_column_int64(statement_.get(), column);
  }
  [[nodiscard]] std::string text(int column) const {
    const auto* text = reinterpret_cast<const char*>(sqlite3_column_text(statement_.get(), column));
    return text == nullptr ? std::string() : std::string(text);
  }

 private:
  struct Finalize {
    void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
  };

  void check(int code) const {
    if (code == SQLITE_OK) return;
    throw Error(fmt::format("the campaign cannot be read: {}", sqlite3_errmsg(connection_)));
  }

  sqlite3* connection_;
  std::unique_ptr<sqlite3_stmt, Finalize> statement_;
};

std::string quoted_name(std::string_view name) {
  std::string quoted = "\"";
  for (const char character : name) quoted.append(character == '"' ? 2 : 1, character);
  return quoted + "\"";
}

std::vector<DataTable> data_tables_of(sqlite3* connection, const std::string& database,
                                      const Model& model) {
  std::vector<DataTable> tables;
  for (const DataTableSchema& schema : model.tables()) {
    const int num_columns = static_cast<int>(schema.columns.size());
    DataTable table{.key = std::string(schema.key),
                    .num_columns = static_cast<std::uint32_t>(num_columns)};
    Selection row(connection, fmt::format("SELECT {} FROM {}.{} ORDER BY position",
                                          fmt::join(schema.columns, ", "), quoted_name(database),
                                          schema.table));
    while (row.step()) {
      for (int column = 0; column < num_columns; ++column) table.values.push_back(row.real(column));
    }
    if (!table.values.empty()) tables.push_back(std::move(table));
  }
  return tables;
}

// One column for each quantity that has values, in the order of Model::drawn().
std::vector<std::vector<double>> table_columns_of(sqlite3* connection, const std::string& database,
                                                  const Model& model) {
  const std::string sql =
      fmt::format("SELECT value FROM {}.dispersion_value WHERE quantity = ? ORDER BY run_index",
                  quoted_name(database));
  std::vector<std::vector<double>> columns;
  for (const DrawnQuantity& drawn : model.drawn()) {
    Selection row(connection, sql);
    row.bind(std::string(drawn.name));
    std::vector<double> column;
    while (row.step()) column.push_back(row.real(0));
    if (!column.empty()) columns.push_back(std::move(column));
  }
  return columns;
}

// Our own programs bring the schema up to date before; the extension takes a file as it is.
const Model& model_of(sqlite3* connection, const std::string& database) {
  constexpr std::int64_t first_with_description = 12;
  Selection version(connection, fmt::format("PRAGMA {}.user_version", quoted_name(database)));
  version.require_row();
  Selection row(
      connection,
      fmt::format("SELECT model_version, {} FROM {}.campaign",
                  version.integer(0) < first_with_description ? "''" : "model_description",
                  quoted_name(database)));
  row.require_row();
  return wire::recorded_model({.version = row.text(0), .description = row.text(1)});
}

std::string name_in(sqlite3* connection, const std::string& database) {
  Selection row(connection, fmt::format("SELECT name FROM {}.campaign", quoted_name(database)));
  row.require_row();
  return row.text(0);
}

// In the order in which they were opened; `temp` holds no campaign.
std::vector<std::string> databases_of(sqlite3* connection) {
  Selection row(connection, "PRAGMA database_list");
  std::vector<std::string> names;
  while (row.step()) {
    if (row.text(1) != "temp") names.push_back(row.text(1));
  }
  return names;
}

}  // namespace

int code_of_exception(sqlite3_vtab& table, const char* name) noexcept {
  try {
    throw;
  } catch (const std::bad_alloc&) {
    return SQLITE_NOMEM;
  } catch (const std::exception& error) {
    sqlite3_free(table.zErrMsg);
    table.zErrMsg = sqlite3_mprintf("%s: %s", name, error.what());
    return SQLITE_ERROR;
  }
}

std::string text_of(sqlite3_value* value) {
  const auto* text = reinterpret_cast<const char*>(sqlite3_value_text(value));
  return text == nullptr ? std::string()
                         : std::string(text, static_cast<std::size_t>(sqlite3_value_bytes(value)));
}

bool ignores_the_argument(const sqlite3_index_info& plan, int column) {
  const std::span constraints(plan.aConstraint, static_cast<std::size_t>(plan.nConstraint));
  return std::ranges::any_of(constraints, [&](const auto& constraint) {
    return constraint.iColumn == column && constraint.op == SQLITE_INDEX_CONSTRAINT_EQ &&
           constraint.usable == 0;
  });
}

std::string database_of(sqlite3* connection, sqlite3_value* argument) {
  if (sqlite3_value_type(argument) == SQLITE_NULL) return "main";
  return database_meant_by(connection, text_of(argument));
}

std::shared_ptr<const Campaign> read_campaign_of(sqlite3* connection, const std::string& database) {
  Selection row(connection, fmt::format("SELECT definition, name, seed, num_runs FROM {}.campaign",
                                        quoted_name(database)));
  row.require_row();
  const Model& model = model_of(connection, database);
  std::shared_ptr<const Campaign> campaign =
      model.campaign_of({.text = row.text(0),
                         .tables = data_tables_of(connection, database, model),
                         .table_columns = table_columns_of(connection, database, model)},
                        TableColumns::included, "stored definition");
  require_identity(*campaign, {.name = row.text(1), .seed = row.text(2), .num_runs = row.text(3)});
  return campaign;
}

std::string database_meant_by(sqlite3* connection, const std::string& argument) {
  const std::vector<std::string> databases = databases_of(connection);
  const auto is_meant = [&](const std::string& name) {
    return sqlite3_stricmp(name.c_str(), argument.c_str()) == 0;
  };
  const auto found = std::ranges::find_if(databases, is_meant);
  if (found != databases.end() && *found == "main") return "main";
  const std::string in_main = name_in(connection, "main");
  if (found == databases.end() && argument == in_main) return "main";
  if (found != databases.end() && argument != in_main) return *found;
  if (found != databases.end()) {
    throw InvalidArgument(fmt::format(
        "campaign = {} (is attached under the name of the campaign in main: attach it under "
        "another name)",
        argument));
  }
  std::string others;
  for (const std::string& name : databases) {
    if (name != "main") others += (others.empty() ? "; attached: " : ", ") + name;
  }
  throw InvalidArgument(
      fmt::format("campaign = {} (the database holds {}{})", argument, in_main, others));
}

DatabaseState state_of(sqlite3* connection, const std::string& database) {
  Selection row(connection, fmt::format("PRAGMA {}.data_version", quoted_name(database)));
  row.require_row();
  return {.data_version = row.integer(0), .num_changes = sqlite3_total_changes64(connection)};
}

}  // namespace proofmass::coordinator
