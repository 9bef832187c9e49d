#include "core/campaign/allocation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "core/error.hpp"

namespace proofmass {
namespace {

/// Steps that one part gives to another.
struct Exchange {
  std::size_t from;
  std::size_t to;
  double value;
};

class Exchanges {
 public:
  Exchanges(const AllocationRule& rule, const std::function<double(std::span<const int>)>& value,
            std::vector<int>& steps)
      : rule_(rule), value_(value), steps_(steps), best_(value(steps)) {}

  /// Makes the best exchange of so many steps; false if none is a gain.
  bool make(int count) {
    std::optional<Exchange> best;
    for (std::size_t from = 0; from < steps_.size(); ++from) {
      if (steps_[from] - count < rule_.minimum) continue;
      for (std::size_t to = 0; to < steps_.size(); ++to) {
        if (to == from) continue;
        move(from, to, count);
        const double value = value_(steps_);
        move(to, from, count);
        if (value > (best ? best->value : best_)) best = {from, to, value};
      }
    }
    if (!best) return false;
    move(best->from, best->to, count);
    best_ = best->value;
    return true;
  }

 private:
  void move(std::size_t from, std::size_t to, int count) {
    steps_[from] -= count;
    steps_[to] += count;
  }

  const AllocationRule& rule_;
  const std::function<double(std::span<const int>)>& value_;
  std::vector<int>& steps_;
  double best_;
};

}  // namespace

std::vector<int> allocate(std::size_t num_parts, const AllocationRule& rule,
                          const std::function<double(std::span<const int>)>& value) {
  const auto count = static_cast<int>(num_parts);
  if (count < 1 || rule.minimum < 1 || rule.num_steps / count < rule.minimum) {
    throw InvalidArgument(fmt::format("{} steps are fewer than {} for each of {} sessions",
                                      rule.num_steps, rule.minimum, num_parts));
  }
  std::vector<int> steps(num_parts, rule.num_steps / count);
  for (int i = 0; i < rule.num_steps % count; ++i) ++steps[static_cast<std::size_t>(i)];
  Exchanges exchanges(rule, value, steps);
  for (int exchanged = std::max(1, rule.num_steps / 4); exchanged > 0; exchanged /= 2) {
    while (exchanges.make(exchanged)) {
    }
  }
  return steps;
}

}  // namespace proofmass
