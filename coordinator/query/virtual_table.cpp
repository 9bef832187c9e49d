#include <sqlite3ext.h>

#include <algorithm>
#include <cstddef>
#include <exception>
#include <new>
#include <span>

#include "coordinator/query/virtual_table-inl.hpp"

SQLITE_EXTENSION_INIT3

namespace proofmass::coordinator {

int code_of_exception(sqlite3_vtab& table, const char* name) noexcept {
  try {
    throw;
  } catch (const std::bad_alloc&) {
    return SQLITE_NOMEM;
  } catch (const std::exception& error) {
    sqlite3_free(table.zErrMsg);
    table.zErrMsg = sqlite3_mprintf("%s: %s", name, error.what());
    return SQLITE_ERROR;
  }
}

std::string text_of(sqlite3_value* value) {
  const auto* text = reinterpret_cast<const char*>(sqlite3_value_text(value));
  return text == nullptr ? std::string()
                         : std::string(text, static_cast<std::size_t>(sqlite3_value_bytes(value)));
}

bool ignores_the_argument(const sqlite3_index_info& plan, int column) {
  const std::span constraints(plan.aConstraint, static_cast<std::size_t>(plan.nConstraint));
  return std::ranges::any_of(constraints, [&](const auto& constraint) {
    return constraint.iColumn == column && constraint.op == SQLITE_INDEX_CONSTRAINT_EQ &&
           constraint.usable == 0;
  });
}

std::string database_of(sqlite3* connection, sqlite3_value* argument) {
  if (sqlite3_value_type(argument) == SQLITE_NULL) return "main";
  return database_meant_by(connection, text_of(argument));
}

}  // namespace proofmass::coordinator
