#include "coordinator/net/campaign_files.hpp"

#include <algorithm>
#include <system_error>

#include "core/statistics/stop_rule.hpp"
#include "proto/link/whole_file.hpp"

namespace proofmass::coordinator {

std::uint64_t horizon_of(const StopPlan& plan, std::uint64_t num_runs_wanted,
                         std::uint64_t num_runs_now) {
  if (plan.stop_rule.empty() || num_runs_wanted < num_runs_now) return num_runs_wanted;
  const std::uint64_t num_before = num_runs_now == 0 ? 0 : num_runs_now - 1;
  return std::min(next_stop_check(num_before), num_runs_wanted);
}

void remove_made(const std::filesystem::path& file) {
  std::error_code ignored;
  std::filesystem::remove(file, ignored);
  (void)wire::synchronise_directory_of(file);
}

}  // namespace proofmass::coordinator
