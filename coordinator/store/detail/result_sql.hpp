#pragma once

#include <string>
#include <string_view>

namespace proofmass::coordinator::detail {

/// The schema as SQL: replaces each word in braces of a file of schema/ by the text that follows
/// from the ResultSchema of the model.
///
///     {data_tables}         the tables of data that all runs share
///     {truth_columns}       columns of run_result, one a line; also {estimate_columns},
///                           {error_columns}; with a comma behind each {standard_error_columns},
///                           {health_columns}
///     {status_name}         status of r, a row of run_result, as text; also {loss_cause_name},
///                           {loss_session_name}
///     {health_values}       columns of r that begin with health_, without that
///     {truth_of_parameter}  truth in r of the parameter p; also {estimate_of_parameter},
///                           {error_of_parameter}
///     {budget_total}        budget total that the errors of a row of run_result leave, m/s²;
///                           {budget_total_at_level} that of a row r at its own level
///     {num_sessions}        also {session_names}, {num_causes}, {cause_names}
///     {digested_tables}     names of the tables that campaign.table_digest is of
///     {example_quantity}    its name, for comments; see example_quantity()
[[nodiscard]] std::string with_quantities(std::string_view sql);

}  // namespace proofmass::coordinator::detail
