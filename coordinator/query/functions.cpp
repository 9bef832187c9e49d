#include <sqlite3ext.h>

#include <array>
#include <cstddef>
#include <exception>
#include <memory>
#include <new>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "coordinator/query/aggregates.hpp"
#include "core/error.hpp"

// Where the program that loads the extension keeps SQLite's functions; empty in our own programs.
SQLITE_EXTENSION_INIT1

namespace proofmass::coordinator {
namespace {

// An argument as a number; empty is NULL. Text is refused: SQL would read it as 0.
std::optional<double> number_of(sqlite3_value* value, std::string_view name) {
  switch (sqlite3_value_type(value)) {
    case SQLITE_NULL:
      return std::nullopt;
    case SQLITE_INTEGER:
    case SQLITE_FLOAT:
      return sqlite3_value_double(value);
    default:
      throw InvalidArgument(std::string(name) + " = text or blob (must be a number)");
  }
}

/// The arguments of a call, one for each name.
class Arguments {
 public:
  Arguments(sqlite3_value** values, std::span<const std::string_view> names) : size_(names.size()) {
    for (std::size_t i = 0; i < size_; ++i) numbers_[i] = number_of(values[i], names[i]);
  }
  [[nodiscard]] std::span<const std::optional<double>> numbers() const {
    return std::span(numbers_).first(size_);
  }

 private:
  std::size_t size_;
  std::array<std::optional<double>, aggregate_arguments_max> numbers_;
};
static_assert(binomial_interval_arguments.size() <= aggregate_arguments_max);

// The rows of the group, which SQLite keeps as a pointer that is null at first; with `size` 0, as
// in the end of a group without rows, there may be none.
AggregateRows** rows_of(sqlite3_context* context, int size) {
  return static_cast<AggregateRows**>(sqlite3_aggregate_context(context, size));
}

const Aggregate& aggregate_of(sqlite3_context* context) {
  return *static_cast<const Aggregate*>(sqlite3_user_data(context));
}

// What goes wrong in a function becomes the error of its statement: no exception passes SQLite.
template <typename Work>
void guard(sqlite3_context* context, const char* name, const Work& work) noexcept {
  try {
    work();
  } catch (const std::bad_alloc&) {
    sqlite3_result_error_nomem(context);
  } catch (const std::exception& error) {
    const std::string text = std::string(name) + ": " + error.what();
    sqlite3_result_error(context, text.c_str(), -1);
  }
}

void step(sqlite3_context* context, int, sqlite3_value** values) {
  const Aggregate& aggregate = aggregate_of(context);
  guard(context, aggregate.name, [&] {
    AggregateRows** rows = rows_of(context, sizeof(AggregateRows*));
    if (rows == nullptr) throw std::bad_alloc();
    if (*rows == nullptr) *rows = new AggregateRows(aggregate);
    (*rows)->add(Arguments(values, aggregate.arguments).numbers());
  });
}

// A row leaves the frame of a window.
void inverse(sqlite3_context* context, int, sqlite3_value** values) {
  const Aggregate& aggregate = aggregate_of(context);
  guard(context, aggregate.name, [&] {
    AggregateRows** rows = rows_of(context, 0);
    PROOFMASS_EXPECT(rows != nullptr && *rows != nullptr);
    (*rows)->remove(Arguments(values, aggregate.arguments).numbers());
  });
}

void tell(sqlite3_context* context, AggregateRows* rows) {
  if (rows == nullptr) return;  // NULL.
  guard(context, aggregate_of(context).name, [&] {
    const std::optional<double> value = rows->value();
    if (value) sqlite3_result_double(context, *value);
  });
}

// Of a frame, which may go on.
void value(sqlite3_context* context) {
  AggregateRows** place = rows_of(context, 0);
  tell(context, place == nullptr ? nullptr : *place);
}

void finish(sqlite3_context* context) {
  AggregateRows** place = rows_of(context, 0);
  const std::unique_ptr<AggregateRows> rows(place == nullptr ? nullptr : *place);
  if (place != nullptr) *place = nullptr;
  tell(context, rows.get());
}

/// One bound of the interval; the name of the function is its data, for messages.
template <double Interval::*bound>
void evaluate_bound(sqlite3_context* context, int, sqlite3_value** values) {
  guard(context, static_cast<const char*>(sqlite3_user_data(context)), [&] {
    const auto interval =
        binomial_interval(Arguments(values, binomial_interval_arguments).numbers());
    if (interval) sqlite3_result_double(context, (*interval).*bound);
  });
}

// Innocuous: functions of their arguments, which views in any file may call.
constexpr int flags = SQLITE_UTF8 | SQLITE_DETERMINISTIC | SQLITE_INNOCUOUS;

int register_aggregate(sqlite3* connection, const Aggregate& aggregate) {
  return sqlite3_create_window_function(
      connection, aggregate.name, static_cast<int>(aggregate.arguments.size()), flags,
      const_cast<Aggregate*>(&aggregate), step, finish, value, inverse, nullptr);
}

template <double Interval::*bound>
int register_bound(sqlite3* connection, const char* name) {
  return sqlite3_create_function_v2(
      connection, name, static_cast<int>(binomial_interval_arguments.size()), flags,
      const_cast<char*>(name), evaluate_bound<bound>, nullptr, nullptr, nullptr);
}

}  // namespace

int register_functions(sqlite3* connection) {
  for (const Aggregate& aggregate : aggregates()) {
    const int code = register_aggregate(connection, aggregate);
    if (code != SQLITE_OK) return code;
  }
  int code = register_bound<&Interval::lower>(connection, "binomial_interval_lower");
  if (code != SQLITE_OK) return code;
  code = register_bound<&Interval::upper>(connection, "binomial_interval_upper");
  return code == SQLITE_OK ? register_tables(connection) : code;
}

}  // namespace proofmass::coordinator

#ifndef SQLITE_CORE
/// Called by SQLite, which derives the name from that of the file, `proofmass_sqlite.so`.
extern "C" __attribute__((visibility("default"))) int sqlite3_proofmasssqlite_init(
    sqlite3* connection, char**, const sqlite3_api_routines* api) {
  SQLITE_EXTENSION_INIT2(api)
  return proofmass::coordinator::register_functions(connection);
}
#endif
