#include "coordinator/store/detail/integrity.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>

#include "coordinator/store/detail/result_rows.hpp"
#include "coordinator/store/detail/schema.hpp"
#include "coordinator/store/detail/standout_rows.hpp"

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

/// Whether the next row has this run and number.
bool has_row(Statement& select, RunIndex run, std::uint64_t number) {
  return select.step() && select.count(0) == run.value && select.count(1) == number;
}

// `overrun` and `worst_run` follow from the results.
void check_standouts(const Database& database) {
  const ParameterArray objectives = read_objectives(database);
  WorstRunTable worst;
  Statement overrun =
      database.prepare("SELECT run_index, parameters FROM overrun ORDER BY run_index");
  Statement row = select_results(database);
  while (row.step()) {
    const RunResult result = read_result(row);
    const std::uint64_t exceeded = exceeded_objectives(result, objectives);
    if (exceeded != 0 && !has_row(overrun, result.run, exceeded)) {
      database.refuse(fmt::format("is damaged: overrun does not follow from the result of run {}",
                                  result.run.value));
    }
    if (!result.has_estimate()) continue;
    for (const ParameterInfo& info : parameter_infos()) {
      worst[index(info.parameter)].offer(
          {.magnitude = std::abs(result.error(info.parameter)), .run = result.run});
    }
  }
  if (overrun.step()) database.refuse("is damaged: overrun has a run too many");
  const WorstRunTable stored = read_worst_runs(database);
  for (const ParameterInfo& info : parameter_infos()) {
    const std::size_t i = index(info.parameter);
    if (stored[i].runs() == worst[i].runs()) continue;
    database.refuse(
        fmt::format("is damaged: worst_run does not follow from the results of {}", info.name));
  }
}

}  // namespace

void check_integrity(const Database& database) {
  const std::string finding = database.text("PRAGMA integrity_check(1)");
  if (finding != "ok") database.refuse_as_damaged(finding);
  check_schema(database);
  check_references(database);
  check_standouts(database);
}

}  // namespace proofmass::coordinator::detail
