#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "coordinator/store/detail/database.hpp"
#include "core/campaign/run_result.hpp"
#include "core/model.hpp"

namespace proofmass::coordinator::detail {

/// `PrMs`: marks an SQLite database as a campaign database.
inline constexpr std::int64_t application_id = 0x50724D73;

/// The version of the first file of schema/, the oldest that this program reads.
inline constexpr std::int64_t oldest_schema_version = 8;

/// The files of schema/ in order, compiled in. The first makes the tables of version
/// oldest_schema_version, each further one leads to the next version.
[[nodiscard]] std::span<const std::string_view> schema_files();

/// What the tables of a campaign database and their columns follow from.
struct StoredKind {
  const Model* model = nullptr;  ///< Of the campaign; lives as long as the program.
  ResultSchema results;          ///< What the results of the campaign are.
};

/// What holds for a row of run_result with a standard error, or its fit; empty if the campaign has
/// none.
[[nodiscard]] std::string has_standard_errors_sql(const ResultSchema& results);

/// The schema files as SQL: each word in braces becomes the text that follows from the model and
/// the results of the campaign.
///
///     {data_tables}         the tables of data that all runs share
///     {truth_columns}       columns of run_result, one a line; also {estimate_columns},
///                           {error_columns}; with a comma behind each {health_columns};
///                           {standard_error_columns}, which are none; as statements that add
///                           them {added_columns}, the standard errors and their fit, and the
///                           index of the runs that have them
///     {status_name}         status of r, a row of run_result, as text; also {loss_cause_name},
///                           {loss_session_name}
///     {health_values}       columns of r that begin with health_, without that; with a comma
///                           before each {fit_values}
///     {truth_of_parameter}  truth in r of the parameter p; also {estimate_of_parameter},
///                           {error_of_parameter}, {standard_error_of_parameter}
///     {budget_total}        budget total that the errors of a row of run_result leave, m/s²;
///                           {budget_total_at_level} that of a row r at its own level
///     {num_sessions}        also {session_names}, {num_causes}, {cause_names}
///     {digested_tables}     names of the tables that campaign.table_digest is of
///     {example_quantity}    its name, for comments; see example_quantity()
[[nodiscard]] std::vector<std::string> migrations(const Model& model, const ResultSchema& results);

/// The version that this program reads and writes.
[[nodiscard]] std::int64_t schema_version();

/// Checks that a database is a campaign database, of a version that this program reads, and that
/// its tables, views and indexes are those of its version and that there is nothing else. Nothing
/// that the file defines is evaluated before its definition has been compared.
/// @throws StoreError otherwise, or if the program does not know the model of its campaign and the
///         file does not tell.
StoredKind check_kind(Database& database);

/// As check_kind(), and that the file is as long as it says, that there is one campaign, and that
/// each page of the tables that do not grow with the runs is what it should be, and the first pages
/// of the others. Takes the same time for any number of runs.
/// @throws StoreError otherwise.
StoredKind check_campaign_file(Database& database);

/// Rows of each table, by its name.
using RowCounts = std::map<std::string, std::uint64_t>;

/// Checks each page of all tables. Takes some 0.1 s for a million runs. @pre check_kind().
/// @throws StoreError naming what is damaged.
RowCounts check_all_pages(const Database& database);

/// Checks that each table, view and index is that of a file of this version, and that there is
/// none else. Reads sqlite_schema only, so that nothing in the file can make it take long.
/// @throws StoreError naming the first that is not.
void check_schema(const Database& database, std::int64_t version, const Model& model,
                  const ResultSchema& results);

/// Checks the CHECK constraints of all rows. SQLite's own check leaves them out where a file is
/// opened for reading alone. @pre check_schema().
/// @throws StoreError naming the table of a row that breaks one.
void check_constraints(const Database& database);

/// The definition of a table, view or index of a campaign without what SQLite 3.25 does not know.
[[nodiscard]] std::string plain_definition(std::string sql);

/// Brings the schema up to date, step by step. @pre Inside a transaction.
void migrate(Database& database, const Model& model, const ResultSchema& results);

}  // namespace proofmass::coordinator::detail
