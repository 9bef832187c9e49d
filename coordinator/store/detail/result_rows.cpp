#include <fmt/format.h>

#include <bit>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <system_error>

#include "coordinator/store/detail/rows.hpp"
#include "coordinator/store/detail/schema.hpp"
#include "coordinator/store/detail/store_impl.hpp"
#include "coordinator/store/records.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/result_columns.hpp"
#include "core/error.hpp"
#include "core/math/hash.hpp"

namespace proofmass::coordinator::detail {
namespace {

// Columns before the values: run_index, status, num_draws, num_rounds.
constexpr int num_leading_columns = 4;

std::string column_list(const ResultColumns& columns) {
  std::string list = "run_index, status, num_draws, num_rounds";
  for (const ValueColumn& column : columns.values) {
    if (column.kind == ValueKind::error || is_of_standard_errors(column)) continue;
    list += ", " + column.name;
  }
  return list + ", loss_cause, loss_session";
}

std::string list_of_standard_errors(const ResultColumns& columns) {
  std::string list;
  for (const ValueColumn& column : columns.values) {
    if (is_of_standard_errors(column)) list += ", " + column.name;
  }
  return columns.num_correlations > 0 ? list + ", correlations" : list;
}

/// `[0.25,-0.125]`, a JSON array.
std::string format_correlations(const std::vector<double>& values) {
  return fmt::format("[{}]", fmt::join(values, ","));
}

std::string insert_sql(const ResultColumns& columns) {
  return fmt::format("INSERT INTO run_result ({}{}) VALUES ({}) ON CONFLICT DO NOTHING",
                     column_list(columns), list_of_standard_errors(columns),
                     places(columns.num_all));
}

std::string select_sql(const ResultColumns& columns, std::string_view clause) {
  return fmt::format("SELECT {} FROM run_result {}", column_list(columns), clause);
}

/// @param condition  Of the runs.
std::string select_standard_errors_sql(const ResultColumns& columns, std::string_view condition) {
  return fmt::format(
      "SELECT run_index{} FROM run_result INDEXED BY run_result_standard_errors "
      "WHERE ({}) AND {} ORDER BY run_index",
      list_of_standard_errors(columns), has_standard_errors_sql(columns.schema), condition);
}

/// Adds the bytes of a number to a digest, lowest first.
std::uint64_t digest_with(std::uint64_t digest, std::uint64_t number) {
  for (int shift = 0; shift < 64; shift += 8) digest = fnv1a(digest, (number >> shift) & 0xff);
  return digest;
}

std::uint64_t digest_with(std::uint64_t digest, double value) {
  return digest_with(digest, std::bit_cast<std::uint64_t>(value + 0.0));  // -0 + 0 is +0.
}

std::uint64_t digest_with(std::uint64_t digest, const std::vector<double>& values) {
  for (const double value : values) digest = digest_with(digest, value);
  return digest;
}

/// A whole number of a column, in [min, max]; a column holds 64 bits.
std::uint32_t read_number(const Statement& row, int column, std::int64_t min, std::int64_t max) {
  const std::int64_t value = row.integer(column);
  if (value >= min && value <= max) return static_cast<std::uint32_t>(value);
  row.refuse_as_damaged(
      fmt::format("{} = {} of run {}", row.column_name(column), value, row.count(0)));
}

constexpr std::int64_t number_max = std::numeric_limits<std::uint32_t>::max();

RunStatus read_status(const Statement& row) {
  return static_cast<RunStatus>(read_number(row, 1, static_cast<std::int64_t>(RunStatus::completed),
                                            static_cast<std::int64_t>(RunStatus::lost)));
}

enum class Numbers : std::uint8_t { any, magnitudes };  ///< Health and fit are magnitudes.

// SQLite would read a missing number as 0.
std::vector<double> read_values(const Statement& row, int first, int count, Numbers numbers) {
  const bool are_magnitudes = numbers == Numbers::magnitudes;
  std::vector<double> values;
  values.reserve(static_cast<std::size_t>(count));
  for (int column = first; column < first + count; ++column) {
    const std::optional<double> value = row.optional_real(column);
    if (value && (!are_magnitudes || (*value >= 0.0 && *value <= magnitude_max))) {
      values.push_back(*value);
    } else if (are_magnitudes) {
      row.refuse_as_damaged(fmt::format("{} of run {} (must be in [0, {}])",
                                        row.column_name(column), row.count(0), magnitude_max));
    } else {
      row.refuse_as_damaged(
          fmt::format("{} = NULL of run {}", row.column_name(column), row.count(0)));
    }
  }
  return values;
}

Loss read_loss(const Statement& row, const ResultColumns& at, RunStatus status) {
  if (status != RunStatus::lost) {
    for (const int column : {at.loss_cause, at.loss_session}) {
      if (!row.optional_count(column)) continue;
      row.refuse_as_damaged(
          fmt::format("{} of run {}, which is not lost", row.column_name(column), row.count(0)));
    }
    return {};
  }
  const auto choice = [&](int column, const std::vector<std::string_view>& names) {
    return read_number(row, column, 1, static_cast<std::int64_t>(names.size()));
  };
  return {.cause = choice(at.loss_cause, at.schema.loss_causes),
          .session = choice(at.loss_session, at.schema.loss_sessions)};
}

// The file is damaged if a number has another type than the schema gives it, or is out of the range
// of its field.
RunResult read_result(const Statement& row, const ResultColumns& at) {
  RunResult result{.run = RunIndex{row.count(0)},
                   .status = read_status(row),
                   .num_draws = read_number(row, 2, 0, number_max),
                   .num_rounds = read_number(row, 3, 0, number_max)};
  if (result.has_truth())
    result.truth = read_values(row, at.truth, at.num_quantities, Numbers::any);
  if (result.has_estimate())
    result.estimate = read_values(row, at.estimate, at.num_quantities, Numbers::any);
  // A run without a draw has no health.
  if (at.num_health > 0 && row.optional_real(at.health)) {
    result.health = read_values(row, at.health, at.num_health, Numbers::magnitudes);
  }
  result.loss = read_loss(row, at, result.status);
  return result;
}

/// What format_correlations() wrote.
std::vector<double> read_correlations(const Statement& row, int column, std::size_t count) {
  const std::string text = row.text(column);
  std::vector<double> values;
  const char* next = text.data();
  const char* const end = next + text.size();
  for (double value = 0.0; next != end && (*next == '[' || *next == ',');) {
    const auto [after, error] = std::from_chars(next + 1, end, value);
    if (error != std::errc() || !(std::abs(value) <= 1.0)) break;
    values.push_back(value);
    next = after;
  }
  // As it was written, so that no other text has the same digest.
  if (values.size() == count && format_correlations(values) == text) return values;
  row.refuse_as_damaged(fmt::format("correlations of run {}", row.count(0)));
}

/// Of a row of select_standard_errors_sql().
void read_standard_errors(const Statement& row, const ResultColumns& at, RunResult& result) {
  result.standard_error = read_values(row, 1, at.num_standard_errors, Numbers::any);
  result.fit = read_values(row, 1 + at.num_standard_errors, at.num_fit, Numbers::magnitudes);
  if (at.num_correlations == 0) return;
  result.correlations =
      read_correlations(row, 1 + at.num_standard_errors + at.num_fit, at.num_correlations);
}

}  // namespace

ResultColumns::ResultColumns(const ResultSchema& results)
    : schema(results),
      values(value_columns(results)),
      num_quantities(static_cast<int>(results.quantities.size())),
      num_standard_errors(static_cast<int>(proofmass::num_standard_errors(results))),
      num_fit(static_cast<int>(results.fit.size())),
      num_correlations(proofmass::num_correlations(results)),
      num_health(static_cast<int>(results.health.size())),
      truth(num_leading_columns),
      estimate(truth + num_quantities),
      health(estimate + num_quantities),
      loss_cause(health + num_health),
      loss_session(loss_cause + 1),
      num_all(loss_session + 1 + num_standard_errors + num_fit + (num_correlations > 0 ? 1 : 0)) {}

ResultRows::ResultRows(const Database& database, const ResultSchema& results)
    : database_(database),
      columns_(results),
      insert_(database.prepare(insert_sql(columns_))),
      select_(database.prepare(select_sql(columns_, "WHERE run_index = ?"))) {
  if (columns_.num_standard_errors == 0) return;
  select_standard_errors_ = database.prepare(select_standard_errors_sql(columns_, "run_index = ?"));
}

bool ResultRows::insert(const RunResult& result) {
  insert_.bind_all(result.run.value, static_cast<std::int64_t>(result.status), result.num_draws,
                   result.num_rounds);
  for (const ValueColumn& column : columns_.values) {
    // An error is computed when it is read.
    if (column.kind == ValueKind::error || is_of_standard_errors(column)) continue;
    insert_.put(column.value_in(result));
  }
  const bool is_lost = result.status == RunStatus::lost;
  const auto choice = [&](std::uint32_t value) {
    return is_lost ? std::optional(std::uint64_t{value}) : std::nullopt;
  };
  insert_.put(choice(result.loss.cause));
  insert_.put(choice(result.loss.session));
  for (const ValueColumn& column : columns_.values) {
    if (is_of_standard_errors(column)) insert_.put(column.value_in(result));
  }
  if (columns_.num_correlations > 0) {
    const std::string correlations = format_correlations(result.correlations);
    insert_.put(result.correlations.empty() ? std::optional<std::string_view>()
                                            : std::optional<std::string_view>(correlations));
  }
  insert_.finish();
  return database_.num_changes() == 1;
}

RunResult ResultRows::read(RunIndex run) {
  select_.bind_all(run.value);
  if (!select_.step()) {
    database_.refuse_as_damaged(fmt::format("run_result lacks run {}", run.value));
  }
  RunResult result = read_result(select_, columns_);
  select_.finish();
  if (!select_standard_errors_) return result;
  select_standard_errors_->bind_all(run.value);
  if (select_standard_errors_->step()) {
    read_standard_errors(*select_standard_errors_, columns_, result);
    select_standard_errors_->finish();
  }
  return result;
}

// Meaningful values are finite, so that equal ones differ in the sign of a zero at most.
bool are_equal(const RunResult& left, const RunResult& right) {
  return left.run == right.run && left.status == right.status &&
         left.num_draws == right.num_draws && left.num_rounds == right.num_rounds &&
         (!left.has_truth() || left.truth == right.truth) &&
         (!left.has_estimate() ||
          (left.estimate == right.estimate && left.standard_error == right.standard_error &&
           left.fit == right.fit && left.correlations == right.correlations)) &&
         left.health == right.health && left.loss == right.loss;
}

std::uint64_t digest(const RunResult& result) {
  std::uint64_t digest = fnv1a_basis;
  for (const std::uint64_t number :
       {result.run.value, static_cast<std::uint64_t>(result.status),
        std::uint64_t{result.num_draws}, std::uint64_t{result.num_rounds}}) {
    digest = digest_with(digest, number);
  }
  if (result.has_truth()) digest = digest_with(digest, result.truth);
  if (result.has_estimate()) digest = digest_with(digest, result.estimate);
  digest = digest_with(digest, result.standard_error);
  digest = digest_with(digest, result.fit);
  digest = digest_with(digest, result.correlations);
  digest = digest_with(digest, result.health);
  if (result.status != RunStatus::lost) return digest;
  digest = digest_with(digest, std::uint64_t{result.loss.cause});
  return digest_with(digest, std::uint64_t{result.loss.session});
}

void check_delivery(const Delivery& delivery, const ResultSchema& results, std::uint64_t num_runs) {
  const RunResult& result = delivery.result;
  if (result.run.value >= num_runs) {
    throw StoreError(fmt::format("run_result.run_index = {} (must be below num_runs = {})",
                                 result.run.value, num_runs));
  }
  try {
    require_in_range(result, results);
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

namespace proofmass::coordinator {

struct ResultReader::Impl {
  Impl(const detail::Database& file, const ResultSchema& results, std::optional<RunRange> runs)
      : database(file),
        columns(results),
        row(file.prepare(detail::select_sql(
            columns, runs ? "WHERE run_index >= ? AND run_index < ? ORDER BY run_index"
                          : "ORDER BY run_index"))) {
    if (columns.num_standard_errors > 0) {
      errors = file.prepare(detail::select_standard_errors_sql(
          columns, runs ? "run_index >= ? AND run_index < ?" : "TRUE"));
    }
    if (!runs) return;
    row.bind_all(runs->first.value, runs->end());
    if (errors) errors->bind_all(runs->first.value, runs->end());
  }

  /// Sets those of a result, if it has any. Begins to read with the first one.
  void add_standard_errors(RunResult& result) {
    while (errors && (!run_with_errors || *run_with_errors < result.run)) {
      run_with_errors = errors->step() ? RunIndex{errors->count(0)}
                                       : RunIndex{std::numeric_limits<std::uint64_t>::max()};
    }
    if (run_with_errors == result.run) detail::read_standard_errors(*errors, columns, result);
  }

  const detail::Database& database;
  detail::ResultColumns columns;
  detail::Statement row;
  std::optional<detail::Statement> errors;  // Of the same state of the file; none if none has any.
  std::optional<RunIndex> run_with_errors;  // Of the row of `errors`; beyond all after the last.
  std::optional<std::uint64_t> num_runs;    // Of the campaign; read with the first result.
  std::optional<RunIndex> last;
};

ResultReader::ResultReader(const detail::Database& database, const ResultSchema& schema,
                           std::optional<RunRange> runs)
    : impl_(std::make_unique<Impl>(database, schema, runs)) {}

ResultReader::~ResultReader() = default;
ResultReader::ResultReader(ResultReader&&) noexcept = default;
ResultReader& ResultReader::operator=(ResultReader&&) noexcept = default;

std::optional<RunResult> ResultReader::next() {
  if (!impl_->row.step()) return std::nullopt;
  // A coordinator may raise the number of runs meanwhile. Once the first row is there, this query
  // is of the same state of the file.
  if (!impl_->num_runs) {
    impl_->num_runs = impl_->database.count("SELECT num_runs FROM campaign");
  }
  RunResult result = detail::read_result(impl_->row, impl_->columns);
  impl_->add_standard_errors(result);
  if (impl_->last && !(*impl_->last < result.run)) {
    impl_->database.refuse_as_damaged(fmt::format("result of run {} comes after that of run {}",
                                                  result.run.value, impl_->last->value));
  }
  if (result.run.value >= *impl_->num_runs) {
    impl_->database.refuse_as_damaged(
        fmt::format("result of run {}, of {} there are", result.run.value, *impl_->num_runs));
  }
  impl_->last = result.run;
  return result;
}

void Store::for_each_error(std::size_t quantity, std::uint64_t num_runs,
                           const std::function<void(double)>& visit) const {
  detail::Statement row = impl_->database.prepare(fmt::format(
      "SELECT error_{} FROM run_result WHERE run_index < ? AND status = {} ORDER BY run_index",
      schema().quantities[quantity].column(), static_cast<std::int64_t>(RunStatus::completed)));
  row.bind_all(num_runs);
  while (row.step()) visit(row.real(0));
}

}  // namespace proofmass::coordinator
