#include "tests/benchmarks/null_result.hpp"

#include <cstddef>
#include <utility>

#include "tests/support/microscope_results.hpp"

namespace proofmass::test {
namespace {

/// In (-1, 1), without visible relation to the arguments.
double made_up(std::uint64_t seed, RunIndex run, std::size_t parameter, std::uint64_t salt) {
  std::uint64_t number = seed + run.value * 0x9e3779b97f4a7c15U + 31 * parameter + salt;
  number = (number ^ (number >> 30)) * 0xbf58476d1ce4e5b9U;
  number = (number ^ (number >> 27)) * 0x94d049bb133111ebU;
  return static_cast<double>(static_cast<std::int64_t>(number ^ (number >> 31)) >> 11) * 0x1.0p-52;
}

}  // namespace

RunResult null_result(std::uint64_t seed, RunIndex run) {
  RunResult result = zero_result({.run = run, .num_draws = 1, .num_rounds = 3});
  for (std::size_t i = 0; i < num_parameters; ++i) {
    result.truth[i] = 1e-4 * made_up(seed, run, i, 0);
    result.estimate[i] = result.truth[i] + 1e-6 * made_up(seed, run, i, 1);
  }
  return result;
}

RunResult null_result(const Campaign& campaign, RunIndex run) {
  RunResult result = null_result(campaign.seed, run);
  if (!campaign.table_quantities().empty()) return result;
  RunDraw draw = campaign.draw(run);
  if (draw.truth.empty()) return result;
  result.num_draws = draw.num_draws;
  for (std::size_t i = 0; i < num_parameters; ++i) {
    result.estimate[i] += draw.truth[i] - result.truth[i];
  }
  result.truth = std::move(draw.truth);
  return result;
}

}  // namespace proofmass::test
