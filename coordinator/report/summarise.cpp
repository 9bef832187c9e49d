#include "coordinator/report/summarise.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "coordinator/report/report.hpp"
#include "core/statistics/stop_rule.hpp"

namespace proofmass::coordinator {
namespace {

/// `std(a_c13)` of `std(a_c13) within 5%`.
std::string_view statistic_of(std::string_view rule) { return rule.substr(0, rule.find(')') + 1); }

StopCheck check_with(const StopRule& rule, std::vector<double> errors) {
  for (double& error : errors) error = std::abs(error);
  return check_stop_rule(rule, errors);
}

std::optional<StoredStopCheck> last_check(const Store& store, const StopPlan& plan) {
  if (plan.stop_rule.empty()) return std::nullopt;
  return store.last_stop_check(statistic_of(plan.stop_rule));
}

}  // namespace

std::optional<std::uint64_t> summarise_file(
    const std::filesystem::path& file, const Scenario& scenario,
    const std::function<void(const std::function<void(Store&)>&)>& write) {
  const Store reader = Store::open_read_only(file);
  const ReadResults results = read_results(reader, scenario);
  const StopPlan plan = reader.stop_plan();
  if (plan.stop_rule.empty()) {
    write([&](Store& store) { write_statistics(store, scenario, results); });
    return std::nullopt;
  }
  const StopRule rule = parse_stop_rule(plan.stop_rule);
  const StopCheck check = check_with(rule, results.accumulator.errors(rule.parameter));
  const std::uint64_t num_runs = reader.num_runs();
  write([&](Store& store) {
    write_statistics(store, scenario, results);
    store.record_stop_check(num_runs, statistic_of(plan.stop_rule), check);
  });
  const std::uint64_t num_runs_max = plan.num_runs_max.value_or(num_runs);
  if (check.is_reached || num_runs >= num_runs_max) return std::nullopt;
  return std::min(next_stop_check(num_runs), num_runs_max);
}

bool is_rule_missed(const Store& store) {
  const auto check = last_check(store, store.stop_plan());
  return check && !check->is_reached;
}

std::string stop_text(const Store& store) {
  const StopPlan plan = store.stop_plan();
  const auto check = last_check(store, plan);
  if (!check) return "";
  const std::string width = check->relative_half_width
                                ? fmt::format("within {:.3g} %, half its 95 % interval",
                                              100.0 * *check->relative_half_width)
                                : std::string("without an interval");
  return fmt::format("Stopping  {} {}\n          after {} runs; {}: {}\n",
                     statistic_of(plan.stop_rule), width, check->num_runs, plan.stop_rule,
                     check->is_reached ? "reached" : "not reached");
}

}  // namespace proofmass::coordinator
