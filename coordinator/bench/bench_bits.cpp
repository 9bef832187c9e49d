#include "coordinator/bench/bench_bits.hpp"

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <tuple>

namespace proofmass::coordinator {
namespace {

bool have_same_bits(const std::vector<double>& a, const std::vector<double>& b) {
  return std::ranges::equal(a, b, [](double x, double y) {
    return std::bit_cast<std::uint64_t>(x) == std::bit_cast<std::uint64_t>(y);
  });
}

}  // namespace

bool have_same_bits(const RunResult& a, const RunResult& b) {
  return std::tie(a.run, a.status, a.num_draws, a.num_rounds) ==
             std::tie(b.run, b.status, b.num_draws, b.num_rounds) &&
         have_same_bits(a.truth, b.truth) && have_same_bits(a.estimate, b.estimate);
}

bool agree_with_known(std::span<const RunResult> results, std::vector<RunResult>& known) {
  bool is_same = true;
  for (std::size_t i = 0; i < results.size(); ++i) {
    if (i == known.size()) known.push_back(results[i]);
    is_same = is_same && have_same_bits(results[i], known[i]);
  }
  return is_same;
}

}  // namespace proofmass::coordinator
