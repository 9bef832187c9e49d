#include "coordinator/query/database_campaigns.hpp"

#include <fmt/format.h>
#include <sqlite3ext.h>

#include <algorithm>
#include <string_view>
#include <vector>

#include "core/error.hpp"
#include "proto/model_program/described_model.hpp"

SQLITE_EXTENSION_INIT3

namespace proofmass::coordinator {
namespace {

/// A statement that reads a database of a connection.
class Selection {
 public:
  Selection(sqlite3* connection, const std::string& sql) : connection_(connection) {
    sqlite3_stmt* statement = nullptr;
    check(sqlite3_prepare_v2(connection, sql.c_str(), -1, &statement, nullptr));
    statement_.reset(statement);
  }

  [[nodiscard]] bool step() {
    const int code = sqlite3_step(statement_.get());
    if (code != SQLITE_ROW && code != SQLITE_DONE) check(code);
    return code == SQLITE_ROW;
  }
  void require_row() {
    if (!step()) throw Error("the database holds no campaign");
  }
  /// All that are left, row by row.
  [[nodiscard]] std::vector<double> numbers() {
    std::vector<double> numbers;
    while (step()) {
      for (int column = 0; column < sqlite3_column_count(statement_.get()); ++column) {
        numbers.push_back(sqlite3_column_double(statement_.get(), column));
      }
    }
    return numbers;
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

// Our own programs bring the schema up to date before; the extension takes a file as it is.
std::shared_ptr<const Campaign> read_campaign_of(sqlite3* connection, const std::string& database) {
  constexpr std::int64_t first_with_description = 12;
  const std::string name = quoted_name(database);
  Selection version(connection, fmt::format("PRAGMA {}.user_version", name));
  version.require_row();
  Selection row(
      connection,
      fmt::format("SELECT definition, name, seed, num_runs, model_version, {} FROM {}.campaign",
                  version.integer(0) < first_with_description ? "''" : "model_description", name));
  row.require_row();
  return wire::recorded_campaign(
      wire::recorded_model({.version = row.text(4), .description = row.text(5)}),
      {.definition = row.text(0),
       .name = row.text(1),
       .seed = row.text(2),
       .num_runs = row.text(3)},
      name, [&](const std::string& sql) { return Selection(connection, sql).numbers(); });
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

std::string database_meant_by(sqlite3* connection, const std::string& argument) {
  const std::vector<std::string> databases = databases_of(connection);
  const auto found = std::ranges::find_if(databases, [&](const std::string& name) {
    return sqlite3_stricmp(name.c_str(), argument.c_str()) == 0;
  });
  if (found != databases.end() && *found == "main") return "main";
  Selection row(connection, "SELECT name FROM main.campaign");
  row.require_row();
  const std::string in_main = row.text(0);
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

}  // namespace

std::shared_ptr<const Campaign> DatabaseCampaigns::current(sqlite3* connection,
                                                           const std::optional<std::string>& name) {
  const std::string database = name ? database_meant_by(connection, *name) : "main";
  Selection row(connection, fmt::format("PRAGMA {}.data_version", quoted_name(database)));
  row.require_row();
  const std::int64_t num_changes = sqlite3_total_changes64(connection);
  Known& known = databases_[database];
  if (!known.campaign || known.data_version != row.integer(0) || known.num_changes != num_changes) {
    known = {.data_version = row.integer(0),
             .num_changes = num_changes,
             .campaign = read_campaign_of(connection, database)};
  }
  return known.campaign;
}

}  // namespace proofmass::coordinator
