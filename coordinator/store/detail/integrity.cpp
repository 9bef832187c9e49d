#include "coordinator/store/detail/integrity.hpp"

#include <fmt/format.h>

#include <string>

#include "coordinator/store/detail/schema.hpp"

namespace proofmass::coordinator::detail {
namespace {

void check_references(const Database& database) {
  Statement select = database.prepare("PRAGMA foreign_key_check");
  if (!select.step()) return;
  database.refuse(
      fmt::format("is damaged: row {} of {} refers to no row of {}; restore it from a "
                  "copy",
                  select.integer(1), select.text(0), select.text(2)));
}

}  // namespace

void check_integrity(const Database& database) {
  const std::string finding = database.text("PRAGMA integrity_check(1)");
  if (finding != "ok") {
    database.refuse(fmt::format("is damaged: {}; restore it from a copy", finding));
  }
  check_schema(database);
  check_references(database);
}

}  // namespace proofmass::coordinator::detail
