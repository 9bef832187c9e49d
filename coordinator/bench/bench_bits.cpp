#include "coordinator/bench/bench_bits.hpp"

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <tuple>

namespace proofmass::coordinator {
bool agree_to_the_bit(const RunResult& a, const RunResult& b) {
  const auto agree = [](const std::vector<double>& left, const std::vector<double>& right) {
    return std::ranges::equal(left, right, {}, std::bit_cast<std::uint64_t, double>,
                              std::bit_cast<std::uint64_t, double>);
  };
  return std::tie(a.run, a.status, a.num_draws, a.num_rounds) ==
             std::tie(b.run, b.status, b.num_draws, b.num_rounds) &&
         agree(a.truth, b.truth) && agree(a.estimate, b.estimate);
}

bool agree_with_known(std::span<const RunResult> results, std::vector<RunResult>& known) {
  bool is_same = true;
  for (std::size_t i = 0; i < results.size(); ++i) {
    if (i == known.size()) known.push_back(results[i]);
    is_same = is_same && agree_to_the_bit(results[i], known[i]);
  }
  return is_same;
}

}  // namespace proofmass::coordinator
