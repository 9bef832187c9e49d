#include "coordinator/query/functions.hpp"

#include <sqlite3ext.h>

#include <array>
#include <exception>
#include <memory>
#include <new>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "coordinator/query/aggregates.hpp"
#include "coordinator/query/draw_table.hpp"
#include "core/error.hpp"

SQLITE_EXTENSION_INIT3

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
void guard(sqlite3_context* context, const Work& work) noexcept {
  try {
    work();
  } catch (const std::bad_alloc&) {
    sqlite3_result_error_nomem(context);
  } catch (const std::exception& error) {
    const std::string text = std::string(aggregate_of(context).name) + ": " + error.what();
    sqlite3_result_error(context, text.c_str(), -1);
  }
}

void step(sqlite3_context* context, int num_arguments, sqlite3_value** values) {
  guard(context, [&] {
    const Aggregate& aggregate = aggregate_of(context);
    AggregateRows** rows = rows_of(context, sizeof(AggregateRows*));
    if (rows == nullptr) throw std::bad_alloc();
    if (*rows == nullptr) *rows = new AggregateRows(aggregate);
    std::array<std::optional<double>, aggregate_arguments_max> arguments;
    for (int i = 0; i < num_arguments; ++i) {
      const auto place = static_cast<std::size_t>(i);
      arguments[place] = number_of(values[i], aggregate.arguments[place]);
    }
    (*rows)->add(std::span(arguments).first(static_cast<std::size_t>(num_arguments)));
  });
}

void finish(sqlite3_context* context) {
  AggregateRows** place = rows_of(context, 0);
  const std::unique_ptr<AggregateRows> rows(place == nullptr ? nullptr : *place);
  if (!rows) return;  // NULL.
  guard(context, [&] {
    const std::optional<double> value = rows->value();
    if (value) sqlite3_result_double(context, *value);
  });
}

int register_aggregate(sqlite3* connection, const Aggregate& aggregate) {
  // Innocuous: a function of its arguments, which views in any file may call.
  constexpr int flags = SQLITE_UTF8 | SQLITE_DETERMINISTIC | SQLITE_INNOCUOUS;
  return sqlite3_create_function_v2(
      connection, aggregate.name, static_cast<int>(aggregate.arguments.size()), flags,
      const_cast<Aggregate*>(&aggregate), nullptr, step, finish, nullptr);
}

}  // namespace

int register_functions(sqlite3* connection) {
  for (const Aggregate& aggregate : aggregates()) {
    const int code = register_aggregate(connection, aggregate);
    if (code != SQLITE_OK) return code;
  }
  return register_draw_table(connection);
}

}  // namespace proofmass::coordinator
