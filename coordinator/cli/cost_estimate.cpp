#include "coordinator/cli/cost_estimate.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <ctime>
#include <utility>
#include <vector>

#include "coordinator/cli/progress_display.hpp"
#include "core/math/instruction_set.hpp"
#include "core/model.hpp"
#include "proto/link/machine.hpp"

namespace proofmass::coordinator {
namespace {

/// Processor time after which the time of a batch is extrapolated.
constexpr double measured_s_max = 0.5;

/// Thrown out of a simulation that has been measured for long enough.
struct Measured {};

/// Size of a campaign database. An empty database has 170 kB; a run adds 8 bytes for each of its
/// numbers and 90 bytes for how and by whom it was computed. Measured with 25 numbers a run.
double database_mb(const ResultSchema& schema, std::uint64_t num_runs) {
  constexpr double empty_size = 170e3, number_size = 8.0, further_size = 90.0;
  // Truth and estimate of each quantity; where each session has a fit, each estimate has an error.
  const auto num_numbers = static_cast<double>(2 * schema.quantities.size() + schema.health.size() +
                                               2 * schema.fit_parts.size());
  const double run_size = number_size * num_numbers + further_size;
  return (empty_size + run_size * static_cast<double>(num_runs)) / 1e6;
}

std::vector<RunRequest> first_requests(const Campaign& campaign, std::size_t count) {
  std::vector<RunRequest> requests;
  for (std::uint64_t run = 0; run < std::min<std::uint64_t>(count, campaign.num_runs); ++run) {
    requests.push_back({.run = {run}, .table_values = campaign.table_values({run})});
  }
  return requests;
}

/// Of a program beside this one, the time that passes: one run, and a batch if that is short.
FirstBatch try_program(const Campaign& campaign, const Plan& plan) {
  using Clock = std::chrono::steady_clock;
  const InstructionSet set = best_instruction_set();
  (void)plan.simulate_batch({}, set);  // Starts it.
  FirstBatch batch;
  for (const std::size_t count : {std::size_t{1}, campaign.model().batch_size()}) {
    const std::vector<RunRequest> requests = first_requests(campaign, count);
    const Clock::time_point start = Clock::now();
    batch.results = plan.simulate_batch(requests, set);
    const double elapsed_s = std::chrono::duration<double>(Clock::now() - start).count();
    batch.time_s = elapsed_s * static_cast<double>(campaign.model().batch_size()) /
                   static_cast<double>(requests.size());
    if (elapsed_s > measured_s_max) break;
  }
  return batch;
}

}  // namespace

FirstBatch try_first_batch(const Campaign& campaign, const Plan& plan) {
  if (!campaign.model().description().empty()) return try_program(campaign, plan);
  const InstructionSet set = best_instruction_set();
  // Scalar code simulates the runs of a batch one after the other.
  const std::size_t num_at_once = set == InstructionSet::scalar ? 1 : campaign.model().batch_size();
  const std::vector<RunRequest> requests = first_requests(campaign, num_at_once);
  const std::clock_t start = std::clock();
  const auto elapsed_s = [start] {
    return static_cast<double>(std::clock() - start) / static_cast<double>(CLOCKS_PER_SEC);
  };
  int num_steps = plan.num_steps();
  std::vector<RunResult> results;
  try {
    results = plan.simulate_batch(requests, set, [&](int num_steps_now) {
      if (num_steps_now == 0 || elapsed_s() < measured_s_max) return;
      num_steps = num_steps_now;
      throw Measured{};
    });
  } catch (const Measured&) {
    // The steps so far are enough.
  }
  const double all_steps = static_cast<double>(plan.num_steps()) / num_steps;
  const std::size_t num_rounds = campaign.model().batch_size() / num_at_once;
  return {.time_s = elapsed_s() * all_steps * static_cast<double>(num_rounds),
          .results = std::move(results)};
}

CostEstimate& CostEstimate::operator+=(const CostEstimate& other) {
  one_core_s += other.one_core_s;
  all_cores_s += other.all_cores_s;
  disk_mb += other.disk_mb;
  return *this;
}

CostEstimate estimated_cost(const Campaign& campaign, std::uint64_t num_runs, double batch_s) {
  const auto time_s = [&](std::uint64_t num_at_a_time) {
    return static_cast<double>((num_runs + num_at_a_time - 1) / num_at_a_time) * batch_s;
  };
  const std::size_t batch_size = campaign.model().batch_size();
  return {.one_core_s = time_s(batch_size),
          .all_cores_s = time_s(batch_size * wire::num_processors()),
          .disk_mb = database_mb(campaign.results(), num_runs)};
}

std::string cost_text(const CostEstimate& cost) {
  return fmt::format(
      "Time      about {} of one core; {} on the {} cores here\n"
      "Disk      about {:.1f} MB\n",
      duration_text(cost.one_core_s), duration_text(cost.all_cores_s), wire::num_processors(),
      cost.disk_mb);
}

}  // namespace proofmass::coordinator
