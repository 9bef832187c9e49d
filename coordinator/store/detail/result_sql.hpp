#pragma once

#include <string>
#include <string_view>

namespace proofmass::coordinator::detail {

/// The schema as SQL: replaces each word in braces of a file of schema/ by the text that follows
/// from the quantities of a result, which are core's parameter_infos(), health_values() and the
/// names of sessions.
///
///     {truth_columns}       columns of run_result, one a line; also {estimate_columns},
///                           {error_columns}, {health_columns}
///     {status_name}         status of r, a row of run_result, as text; also {loss_cause_name},
///                           {loss_session_name}
///     {health_values}       columns of r that begin with health_, without that
///     {truth_of_parameter}  truth in r of the parameter p; also {estimate_of_parameter},
///                           {error_of_parameter}
///     {budget_total}        budget total that the errors of a row of run_result leave, m/s²
///     {num_sessions}        also {session_names}
[[nodiscard]] std::string with_quantities(std::string_view sql);

}  // namespace proofmass::coordinator::detail
