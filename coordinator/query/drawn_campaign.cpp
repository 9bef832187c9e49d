#include "coordinator/query/drawn_campaign.hpp"

#include <fmt/format.h>
#include <sqlite3ext.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "core/campaign/model.hpp"
#include "core/error.hpp"
#include "core/runs.hpp"

SQLITE_EXTENSION_INIT3

namespace proofmass::coordinator {
namespace {

/// A statement that reads a database of a connection.
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

std::vector<DataTable> data_tables_of(sqlite3* connection, const std::string& database) {
  std::vector<DataTable> tables;
  for (const DataTableSchema& schema : model().results().tables) {
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
std::vector<std::vector<double>> table_columns_of(sqlite3* connection,
                                                  const std::string& database) {
  const std::string sql =
      fmt::format("SELECT value FROM {}.dispersion_value WHERE quantity = ? ORDER BY run_index",
                  quoted_name(database));
  std::vector<std::vector<double>> columns;
  for (const DrawnQuantity& drawn : model().drawn()) {
    Selection row(connection, sql);
    row.bind(std::string(drawn.name));
    std::vector<double> column;
    while (row.step()) column.push_back(row.real(0));
    if (!column.empty()) columns.push_back(std::move(column));
  }
  return columns;
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

std::shared_ptr<const Campaign> read_campaign_of(sqlite3* connection, const std::string& database) {
  Selection row(connection, fmt::format("SELECT definition, name, seed, num_runs FROM {}.campaign",
                                        quoted_name(database)));
  row.require_row();
  std::shared_ptr<const Campaign> campaign =
      model().campaign_of({.text = row.text(0),
                           .tables = data_tables_of(connection, database),
                           .table_columns = table_columns_of(connection, database)},
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

DrawnCampaign::DrawnCampaign(std::shared_ptr<const Campaign> campaign)
    : campaign_(std::move(campaign)) {}

const std::vector<double>& DrawnCampaign::values_of(RunIndex run) {
  if (last_run_ == run) return last_values_;
  last_values_ = campaign_->draw(run).values;
  last_run_ = run;
  return last_values_;
}

void DrawScan::narrow(RunComparison comparison, std::int64_t bound) {
  // One step outside all run indices excludes or admits as much as any further one.
  const auto limit = static_cast<std::int64_t>(num_runs_max);
  const std::int64_t run = std::clamp<std::int64_t>(bound, -1, limit);
  const auto not_negative = [](std::int64_t value) {
    return static_cast<std::uint64_t>(std::max<std::int64_t>(value, 0));
  };
  const bool is_lower = comparison != RunComparison::below && comparison != RunComparison::at_most;
  const bool is_upper = comparison != RunComparison::above && comparison != RunComparison::at_least;
  const std::int64_t first = comparison == RunComparison::above ? run + 1 : run;
  const std::int64_t end = comparison == RunComparison::below ? run : run + 1;
  if (is_lower) first_run = std::max(first_run, not_negative(first));
  if (is_upper) end_run = std::min(end_run, not_negative(end));
  end_run = std::max(first_run, end_run);
}

void DrawScan::narrow(RunComparison comparison, double bound) {
  const double limit = static_cast<double>(num_runs_max);
  const double run = std::floor(std::clamp(bound, -1.0, limit));
  // Between two indices, or at one: what is below it is at most the index before or it.
  const bool is_below = comparison == RunComparison::below;
  const bool is_above = comparison == RunComparison::above;
  narrow(is_below   ? RunComparison::at_most
         : is_above ? RunComparison::at_least
                    : comparison,
         static_cast<std::int64_t>(run));
}

}  // namespace proofmass::coordinator
