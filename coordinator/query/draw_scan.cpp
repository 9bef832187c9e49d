#include "coordinator/query/draw_scan.hpp"

#include <algorithm>
#include <cmath>

#include "core/runs.hpp"

namespace proofmass::coordinator {

void DrawScan::narrow(RunComparison comparison, std::int64_t bound) {
  // One step outside all run indices excludes or admits as much as any further one.
  const auto limit = static_cast<std::int64_t>(num_runs_max);
  const std::int64_t run = std::clamp<std::int64_t>(bound, -1, limit);
  const auto not_negative = [](std::int64_t value) {
    return static_cast<std::uint64_t>(std::max<std::int64_t>(value, 0));
  };
  const bool is_lower = comparison != RunComparison::below && comparison != RunComparison::at_most;
  const bool is_upper = comparison != RunComparison::above && comparison != RunComparison::at_least;
  const std::int64_t first = comparison == RunComparison::above ? run + 1 : run;
  const std::int64_t end = comparison == RunComparison::below ? run : run + 1;
  if (is_lower) first_run = std::max(first_run, not_negative(first));
  if (is_upper) end_run = std::min(end_run, not_negative(end));
  end_run = std::max(first_run, end_run);
}

void DrawScan::narrow(RunComparison comparison, double bound) {
  const double limit = static_cast<double>(num_runs_max);
  const double run = std::floor(std::clamp(bound, -1.0, limit));
  // Between two indices, or at one: what is below it is at most the index before or it.
  const bool is_below = comparison == RunComparison::below;
  const bool is_above = comparison == RunComparison::above;
  narrow(is_below   ? RunComparison::at_most
         : is_above ? RunComparison::at_least
                    : comparison,
         static_cast<std::int64_t>(run));
}

}  // namespace proofmass::coordinator
