#include "coordinator/store/detail/table_digest.hpp"

#include <fmt/format.h>

#include "coordinator/store/sha256.hpp"
#include "core/campaign/model.hpp"

namespace proofmass::coordinator::detail {
namespace {

// How the campaign is served is left out: it changes while a coordinator has the file.
void add_campaign(const Database& database, Sha256& hash) {
  Statement row = database.prepare(
      "SELECT name, seed, num_runs, definition, model_version, build, created_utc, campaign_uid,"
      " owner, stop_rule, num_runs_max, failures_max FROM campaign");
  if (!row.step()) database.refuse_as_damaged("it has no campaign");
  for (int column = 0; column < row.num_columns(); ++column) hash.add(row.shown(column));
}

void add_data_tables(const Database& database, Sha256& hash) {
  for (const DataTableSchema& table : model().results().tables) {
    hash.add(database.count(fmt::format("SELECT count(*) FROM {}", table.table)));
    Statement row = database.prepare(fmt::format("SELECT position, {} FROM {} ORDER BY position",
                                                 fmt::join(table.columns, ", "), table.table));
    while (row.step()) {
      hash.add(row.count(0));
      for (int column = 1; column < row.num_columns(); ++column) hash.add(row.real(column));
    }
  }
}

void add_dispersions(const Database& database, Sha256& hash) {
  hash.add(database.count("SELECT count(*) FROM dispersion_value"));
  Statement row = database.prepare(
      "SELECT quantity, run_index, value FROM dispersion_value ORDER BY quantity, run_index");
  while (row.step()) {
    hash.add(row.text(0));
    hash.add(row.count(1));
    hash.add(row.real(2));
  }
}

}  // namespace

std::string compute_table_digest(const Database& database) {
  Sha256 hash;
  add_campaign(database, hash);
  add_data_tables(database, hash);
  add_dispersions(database, hash);
  return hash.finish();
}

void write_table_digest(const Database& database) {
  database.prepare("UPDATE campaign SET table_digest = ?").run(compute_table_digest(database));
}

}  // namespace proofmass::coordinator::detail
