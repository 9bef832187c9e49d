#include <fmt/format.h>
#include <sqlite3.h>

#include <cmath>
#include <limits>

#include "coordinator/store/detail/database.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator::detail {

void FinalizeStatement::operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }

Statement::Statement(const Database& database, sqlite3_stmt* statement)
    : database_(&database), statement_(statement) {}

void Statement::check(int code) const {
  if (code != SQLITE_OK) database_->fail(code);
}

void Statement::put(std::int64_t value) {
  check(sqlite3_bind_int64(statement_.get(), ++num_bound_, value));
}

void Statement::put(std::uint64_t value) {
  if (value > static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max())) {
    database_->refuse(fmt::format("a number to be stored = {} (must be below 2⁶³)", value));
  }
  put(static_cast<std::int64_t>(value));
}

void Statement::put(double value) {
  if (!std::isfinite(value)) {
    database_->refuse(fmt::format("a number to be stored = {} (must be finite)", value));
  }
  check(sqlite3_bind_double(statement_.get(), ++num_bound_, value));
}

void Statement::put_null() { check(sqlite3_bind_null(statement_.get(), ++num_bound_)); }

void Statement::put(std::string_view value) {
  check(sqlite3_bind_text64(statement_.get(), ++num_bound_, value.data(), value.size(),
                            SQLITE_TRANSIENT, SQLITE_UTF8));
}

bool Statement::step() {
  const int code = sqlite3_step(statement_.get());
  if (code == SQLITE_ROW) return true;
  sqlite3_reset(statement_.get());
  if (code != SQLITE_DONE) database_->fail(code);
  return false;
}

void Statement::put(const std::optional<Interval>& interval) {
  put(interval ? std::optional(interval->lower) : std::nullopt);
  put(interval ? std::optional(interval->upper) : std::nullopt);
}

void Statement::finish() {
  while (step()) {
  }
  num_bound_ = 0;
}

double Statement::real(int column) const { return sqlite3_column_double(statement_.get(), column); }

std::int64_t Statement::integer(int column) const {
  return sqlite3_column_int64(statement_.get(), column);
}

std::uint64_t Statement::count(int column) const {
  const std::int64_t value = integer(column);
  if (value < 0) {
    refuse_as_damaged(fmt::format("{} = {}", sqlite3_column_name(statement_.get(), column), value));
  }
  return static_cast<std::uint64_t>(value);
}

std::optional<double> Statement::optional_real(int column) const {
  if (sqlite3_column_type(statement_.get(), column) == SQLITE_NULL) return std::nullopt;
  return real(column);
}

std::optional<std::uint64_t> Statement::optional_count(int column) const {
  if (sqlite3_column_type(statement_.get(), column) == SQLITE_NULL) return std::nullopt;
  return count(column);
}

std::string Statement::text(int column) const {
  const auto* text = reinterpret_cast<const char*>(sqlite3_column_text(statement_.get(), column));
  const int size = sqlite3_column_bytes(statement_.get(), column);
  return text == nullptr ? std::string() : std::string(text, static_cast<std::size_t>(size));
}

std::optional<Interval> Statement::interval(int column) const {
  const std::optional<double> lower = optional_real(column);
  const std::optional<double> upper = optional_real(column + 1);
  if (!lower || !upper) return std::nullopt;
  return Interval{.lower = *lower, .upper = *upper, .confidence = default_confidence};
}

std::string Statement::shown(int column) const {
  switch (sqlite3_column_type(statement_.get(), column)) {
    case SQLITE_NULL:
      return "NULL";
    case SQLITE_FLOAT:
      return fmt::format("{}", real(column));
    default:
      return text(column);
  }
}

int Statement::num_columns() const { return sqlite3_column_count(statement_.get()); }

std::string Statement::column_name(int column) const {
  return sqlite3_column_name(statement_.get(), column);
}

void Statement::refuse_as_damaged(std::string_view what) const {
  database_->refuse_as_damaged(what);
}

}  // namespace proofmass::coordinator::detail
