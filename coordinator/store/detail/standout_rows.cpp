#include "coordinator/store/detail/standout_rows.hpp"

#include <algorithm>
#include <cmath>

namespace proofmass::coordinator::detail {
namespace {

bool is_worse(const WorstRun& left, const WorstRun& right) {
  if (left.magnitude != right.magnitude) return left.magnitude > right.magnitude;
  return left.run < right.run;
}

}  // namespace

WorstRuns::Change WorstRuns::offer(const WorstRun& offered) {
  const bool is_full = runs_.size() == num_worst_runs;
  if (is_full && !is_worse(offered, runs_.back())) return {};
  Change change{.is_taken = true, .dropped = std::nullopt};
  if (is_full) {
    change.dropped = runs_.back().run;
    runs_.pop_back();
  }
  runs_.insert(std::upper_bound(runs_.begin(), runs_.end(), offered, is_worse), offered);
  return change;
}

WorstRunTable read_worst_runs(const Database& database) {
  Statement select =
      database.prepare("SELECT magnitude, run_index FROM worst_run WHERE parameter = ?");
  WorstRunTable table;
  for (const ParameterInfo& info : parameter_infos()) {
    select.bind_all(info.name);
    while (select.step()) {
      table[index(info.parameter)].offer(
          {.magnitude = select.real(0), .run = RunIndex{select.count(1)}});
    }
  }
  return table;
}

ParameterArray read_objectives(const Database& database) {
  Statement select = database.prepare("SELECT objective FROM parameter WHERE parameter = ?");
  ParameterArray objectives{};
  for (const ParameterInfo& info : parameter_infos()) {
    select.bind_all(info.name);
    if (!select.step()) database.refuse("is damaged: it lacks a parameter");
    objectives[index(info.parameter)] = select.real(0);
    select.finish();
  }
  return objectives;
}

std::uint64_t exceeded_objectives(const RunResult& result, const ParameterArray& objectives) {
  std::uint64_t exceeded = 0;
  if (!result.has_estimate()) return exceeded;
  for (const ParameterInfo& info : parameter_infos()) {
    const std::size_t i = index(info.parameter);
    const bool is_beyond = std::abs(result.error(info.parameter)) > objectives[i];
    exceeded |= std::uint64_t{is_beyond} << i;
  }
  return exceeded;
}

StandoutRows::StandoutRows(const Database& database)
    : objectives_(read_objectives(database)),
      worst_(read_worst_runs(database)),
      insert_overrun_(database.prepare("INSERT INTO overrun VALUES (?, ?)")),
      insert_worst_(database.prepare("INSERT INTO worst_run VALUES (?, ?, ?)")),
      delete_worst_(
          database.prepare("DELETE FROM worst_run WHERE parameter = ? AND run_index = ?")) {}

void StandoutRows::add(const RunResult& result) {
  if (!result.has_estimate()) return;
  const std::uint64_t exceeded = exceeded_objectives(result, objectives_);
  if (exceeded != 0) insert_overrun_.run(result.run.value, exceeded);
  for (const ParameterInfo& info : parameter_infos()) {
    const double magnitude = std::abs(result.error(info.parameter));
    const WorstRuns::Change change =
        worst_[index(info.parameter)].offer({.magnitude = magnitude, .run = result.run});
    if (change.dropped) delete_worst_.run(info.name, change.dropped->value);
    if (change.is_taken) insert_worst_.run(info.name, result.run.value, magnitude);
  }
}

}  // namespace proofmass::coordinator::detail
