#include "coordinator/store/detail/largest_error_rows.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string_view>

#include "core/campaign/model.hpp"

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
  for (const Quantity& quantity : model().results().quantities) {
    WorstRuns& worst = table.emplace_back();
    select.bind_all(quantity.name);
    while (select.step()) {
      worst.offer({.magnitude = select.real(0), .run = RunIndex{select.count(1)}});
    }
  }
  return table;
}

std::vector<double> read_objectives(const Database& database) {
  Statement select = database.prepare("SELECT objective FROM parameter WHERE parameter = ?");
  std::vector<double> objectives;
  for (const Quantity& quantity : model().results().quantities) {
    select.bind_all(quantity.name);
    if (!select.step()) database.refuse("is damaged: it lacks a parameter");
    objectives.push_back(select.optional_real(0).value_or(std::numeric_limits<double>::infinity()));
    select.finish();
  }
  return objectives;
}

std::uint64_t exceeded_objectives(const RunResult& result, std::span<const double> objectives) {
  std::uint64_t exceeded = 0;
  if (!result.has_estimate()) return exceeded;
  for (std::size_t i = 0; i < objectives.size(); ++i) {
    const bool is_beyond = std::abs(result.error(i)) > objectives[i];
    exceeded |= std::uint64_t{is_beyond} << i;
  }
  return exceeded;
}

LargestErrorRows::LargestErrorRows(const Database& database)
    : objectives_(read_objectives(database)),
      worst_(read_worst_runs(database)),
      insert_overrun_(database.prepare("INSERT INTO overrun VALUES (?, ?)")),
      insert_worst_(database.prepare("INSERT INTO worst_run VALUES (?, ?, ?)")),
      delete_worst_(
          database.prepare("DELETE FROM worst_run WHERE parameter = ? AND run_index = ?")) {}

void LargestErrorRows::add(const RunResult& result) {
  if (!result.has_estimate()) return;
  const std::uint64_t exceeded = exceeded_objectives(result, objectives_);
  if (exceeded != 0) insert_overrun_.run(result.run.value, exceeded);
  for (std::size_t i = 0; i < worst_.size(); ++i) {
    const double magnitude = std::abs(result.error(i));
    const std::string_view name = model().results().quantities[i].name;
    const WorstRuns::Change change = worst_[i].offer({.magnitude = magnitude, .run = result.run});
    if (change.dropped) delete_worst_.run(name, change.dropped->value);
    if (change.is_taken) insert_worst_.run(name, result.run.value, magnitude);
  }
}

}  // namespace proofmass::coordinator::detail
