#include "coordinator/store/detail/result_rows.hpp"

#include <fmt/format.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <string>

#include "coordinator/store/store_error.hpp"

namespace proofmass::coordinator::detail {
namespace {

// Columns before the parameters': run_index, status, num_draws, num_rounds.
constexpr int num_leading_columns = 4;
// After them, from 0: those of LoopHealth, then loss_cause and loss_session.
constexpr int first_health_column = num_leading_columns + 2 * static_cast<int>(num_parameters);
constexpr int num_health_columns = static_cast<int>(num_health_values);
constexpr int loss_cause_column = first_health_column + num_health_columns;
constexpr int loss_session_column = loss_cause_column + 1;
constexpr int num_columns = loss_session_column + 1;

// Position of a parameter's truth among the columns, from 0; its estimate stands num_parameters on.
int truth_column(const ParameterInfo& info) {
  return num_leading_columns + static_cast<int>(index(info.parameter));
}
int estimate_column(const ParameterInfo& info) {
  return truth_column(info) + static_cast<int>(num_parameters);
}

std::string column_list() {
  std::string truths, estimates;
  for (const ParameterInfo& info : parameter_infos()) {
    truths += fmt::format(", truth_{}{}", info.name, info.unit_suffix);
    estimates += fmt::format(", estimate_{}{}", info.name, info.unit_suffix);
  }
  std::string health;
  for (const HealthValue& value : health_values()) {
    health += fmt::format(", health_{}{}", value.name, value.unit_suffix);
  }
  return "run_index, status, num_draws, num_rounds" + truths + estimates + health +
         ", loss_cause, loss_session";
}

std::string insert_sql() {
  std::string values = "?";
  for (int column = 1; column < num_columns; ++column) values += ", ?";
  return fmt::format("INSERT INTO run_result ({}) VALUES ({}) ON CONFLICT DO NOTHING",
                     column_list(), values);
}

std::string select_sql(std::string_view clause) {
  return fmt::format("SELECT {} FROM run_result {}", column_list(), clause);
}

/// Adds the bytes of a number to a digest, lowest first [RFC 9923].
std::uint64_t digest_with(std::uint64_t digest, std::uint64_t number) {
  constexpr std::uint64_t prime = 0x100000001b3;
  for (int shift = 0; shift < 64; shift += 8) {
    digest = (digest ^ ((number >> shift) & 0xff)) * prime;
  }
  return digest;
}

std::uint64_t digest_with(std::uint64_t digest, double value) {
  return digest_with(digest, std::bit_cast<std::uint64_t>(value + 0.0));  // -0 + 0 is +0.
}

std::uint64_t digest_with(std::uint64_t digest, const ParameterArray& values) {
  for (const double value : values) digest = digest_with(digest, value);
  return digest;
}

// A column holds 64 bits.
std::uint32_t read_number(const Statement& row, int column) {
  const std::uint64_t value = row.count(column);
  if (value <= std::numeric_limits<std::uint32_t>::max()) return static_cast<std::uint32_t>(value);
  row.refuse_as_damaged(
      fmt::format("{} = {} of run {}", row.column_name(column), value, row.count(0)));
}

RunStatus read_status(const Statement& row) {
  const std::int64_t status = row.integer(1);
  const bool is_known = status >= static_cast<std::int64_t>(RunStatus::completed) &&
                        status <= static_cast<std::int64_t>(RunStatus::lost);
  if (is_known) return static_cast<RunStatus>(status);
  row.refuse_as_damaged(fmt::format("status = {} of run {}", status, row.count(0)));
}

// A run without a draw has none.
std::optional<LoopHealth> read_health(const Statement& row) {
  if (!row.optional_real(first_health_column)) return std::nullopt;
  LoopHealth health;
  for (std::size_t i = 0; i < num_health_values; ++i) {
    const int column = first_health_column + static_cast<int>(i);
    const double value = row.optional_real(column).value_or(-1.0);
    if (!(value >= 0.0 && value <= magnitude_max)) {
      row.refuse_as_damaged(fmt::format("{} of run {} (must be in [0, {}])",
                                        row.column_name(column), row.count(0), magnitude_max));
    }
    health.*health_values()[i].member = value;
  }
  return health;
}

std::int64_t read_choice(const Statement& row, int column, std::size_t count) {
  const std::int64_t value = row.integer(column);
  if (value >= 1 && value <= static_cast<std::int64_t>(count)) return value;
  row.refuse_as_damaged(
      fmt::format("{} = {} of run {}", row.column_name(column), value, row.count(0)));
}

Loss read_loss(const Statement& row, RunStatus status) {
  if (status != RunStatus::lost) {
    for (const int column : {loss_cause_column, loss_session_column}) {
      if (!row.optional_count(column)) continue;
      row.refuse_as_damaged(
          fmt::format("{} of run {}, which is not lost", row.column_name(column), row.count(0)));
    }
    return {};
  }
  return {.cause = static_cast<LossCause>(read_choice(row, loss_cause_column, num_loss_causes)),
          .session = static_cast<SessionTarget>(
              read_choice(row, loss_session_column, num_session_targets))};
}

// SQLite would read a missing number as 0.
double read_value(const Statement& row, int column, bool is_known) {
  const std::optional<double> value = row.optional_real(column);
  if (is_known && !value) {
    row.refuse_as_damaged(
        fmt::format("{} = NULL of run {}", row.column_name(column), row.count(0)));
  }
  return value.value_or(0.0);
}

}  // namespace

ResultRows::ResultRows(const Database& database)
    : database_(database),
      insert_(database.prepare(insert_sql())),
      select_(database.prepare(select_sql("WHERE run_index = ?"))) {}

bool ResultRows::insert(const RunResult& result) {
  insert_.bind(1, result.run.value);
  insert_.bind(2, static_cast<std::int64_t>(result.status));
  insert_.bind(3, result.num_draws);
  insert_.bind(4, result.num_rounds);
  for (const ParameterInfo& info : parameter_infos()) {
    const std::size_t i = index(info.parameter);
    const auto truth = result.has_truth() ? std::optional(result.truth[i]) : std::nullopt;
    const auto estimate = result.has_estimate() ? std::optional(result.estimate[i]) : std::nullopt;
    insert_.bind(truth_column(info) + 1, truth);
    insert_.bind(estimate_column(info) + 1, estimate);
  }
  for (std::size_t i = 0; i < num_health_values; ++i) {
    const auto value =
        result.health ? std::optional((*result.health).*health_values()[i].member) : std::nullopt;
    insert_.bind(first_health_column + static_cast<int>(i) + 1, value);
  }
  const auto choice = [&](auto value) {
    return result.status == RunStatus::lost ? std::optional(static_cast<std::uint64_t>(value))
                                            : std::nullopt;
  };
  insert_.bind(loss_cause_column + 1, choice(result.loss.cause));
  insert_.bind(loss_session_column + 1, choice(result.loss.session));
  insert_.finish();
  return database_.num_changes() == 1;
}

RunResult ResultRows::read(RunIndex run) {
  select_.bind_all(run.value);
  if (!select_.step()) {
    database_.refuse_as_damaged(fmt::format("run_result lacks run {}", run.value));
  }
  const RunResult result = read_result(select_);
  select_.finish();
  return result;
}

Statement select_results(const Database& database) {
  return database.prepare(select_sql("ORDER BY run_index"));
}

Statement select_results_in_range(const Database& database) {
  return database.prepare(select_sql("WHERE run_index >= ? AND run_index < ? ORDER BY run_index"));
}

RunResult read_result(const Statement& row) {
  RunResult result{.run = RunIndex{row.count(0)},
                   .status = read_status(row),
                   .num_draws = read_number(row, 2),
                   .num_rounds = read_number(row, 3)};
  for (const ParameterInfo& info : parameter_infos()) {
    result.truth[index(info.parameter)] = read_value(row, truth_column(info), result.has_truth());
    result.estimate[index(info.parameter)] =
        read_value(row, estimate_column(info), result.has_estimate());
  }
  result.health = read_health(row);
  result.loss = read_loss(row, result.status);
  return result;
}

// Meaningful values are finite, so that equal ones differ in the sign of a zero at most.
bool are_equal(const RunResult& left, const RunResult& right) {
  return left.run == right.run && left.status == right.status &&
         left.num_draws == right.num_draws && left.num_rounds == right.num_rounds &&
         (!left.has_truth() || left.truth == right.truth) &&
         (!left.has_estimate() || left.estimate == right.estimate) && left.health == right.health &&
         left.loss == right.loss;
}

std::uint64_t digest(const RunResult& result) {
  constexpr std::uint64_t offset_basis = 0xcbf29ce484222325;
  std::uint64_t digest = offset_basis;
  for (const std::uint64_t number :
       {result.run.value, static_cast<std::uint64_t>(result.status),
        std::uint64_t{result.num_draws}, std::uint64_t{result.num_rounds}}) {
    digest = digest_with(digest, number);
  }
  if (result.has_truth()) digest = digest_with(digest, result.truth);
  if (result.has_estimate()) digest = digest_with(digest, result.estimate);
  if (!result.health) return digest;
  for (const HealthValue& value : health_values()) {
    digest = digest_with(digest, (*result.health).*value.member);
  }
  if (result.status != RunStatus::lost) return digest;
  digest = digest_with(digest, static_cast<std::uint64_t>(result.loss.cause));
  return digest_with(digest, static_cast<std::uint64_t>(result.loss.session));
}

void check_delivery(const Delivery& delivery, std::uint64_t num_runs) {
  const RunResult& result = delivery.result;
  if (result.run.value >= num_runs) {
    throw StoreError(fmt::format("run_result.run_index = {} (must be below num_runs = {})",
                                 result.run.value, num_runs));
  }
  try {
    require_in_range(result);
  } catch (const Error& error) {
    throw StoreError(fmt::format("run_result.{}", error.what()));
  }
  // A sum over all runs of a campaign stays finite, and so does what people make of it.
  constexpr double compute_s_max = 1e9;
  if (!(delivery.compute_s >= 0.0 && delivery.compute_s <= compute_s_max)) {
    throw StoreError(fmt::format("delivery.compute_s = {} (must be in [0, 1e9]; run {})",
                                 delivery.compute_s, result.run.value));
  }
}

}  // namespace proofmass::coordinator::detail
