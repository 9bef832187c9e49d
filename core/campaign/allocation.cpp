#include "core/campaign/allocation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <limits>
#include <numeric>

#include "core/error.hpp"

namespace proofmass {
namespace {

/// Slopes of the value in the steps of one part. A concave value rises by no more than `before` and
/// falls by no less than `after` for each step that the part gets or gives.
struct Slopes {
  double before;  ///< Rise by the part's last step.
  double after;   ///< Rise by one step more.

  [[nodiscard]] double middle() const { return 0.5 * (before + after); }
};

/// a − b, also of equal infinities.
double difference(double a, double b) { return a == b ? 0.0 : a - b; }

class Exchanges {
 public:
  Exchanges(const AllocationRule& rule, const std::function<double(std::span<const int>)>& value,
            std::vector<int>& steps)
      : rule_(rule), value_(value), steps_(steps), best_(value(steps)) {}

  /// Exchanges so many steps between two parts for as long as that is a gain; false if it is none
  /// for any two. Those come first that promise most.
  bool make(int count) {
    const std::vector<Slopes> slopes = slopes_here();
    std::vector<std::size_t> order(steps_.size());  // Of rising slope.
    std::iota(order.begin(), order.end(), 0U);
    std::ranges::stable_sort(order, {}, [&](std::size_t i) { return slopes[i].middle(); });
    for (auto to = order.rbegin(); to != order.rend(); ++to) {
      for (const std::size_t from : order) {
        if (from == *to || slopes[*to].before <= slopes[from].after) continue;
        if (!gain(from, *to, count)) continue;
        while (gain(from, *to, count)) {
        }
        return true;
      }
    }
    return false;
  }

 private:
  [[nodiscard]] std::vector<Slopes> slopes_here() {
    constexpr double unknown = std::numeric_limits<double>::infinity();
    std::vector<Slopes> slopes;
    for (int& steps : steps_) {
      ++steps;
      const double after = difference(value_(steps_), best_);
      --steps;
      double before = unknown;
      if (steps > 1) {
        --steps;
        before = difference(best_, value_(steps_));
        ++steps;
      }
      slopes.push_back({before, after});
    }
    return slopes;
  }

  /// Exchanges steps if that is a gain.
  bool gain(std::size_t from, std::size_t to, int count) {
    if (steps_[from] - count < rule_.minimum || steps_[to] > rule_.maximum - count) return false;
    move(from, to, count);
    const double value = value_(steps_);
    if (value > best_) {
      best_ = value;
      return true;
    }
    move(to, from, count);
    return false;
  }

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
  const auto count = static_cast<std::int64_t>(num_parts);
  if (count < 1 || rule.minimum < 1 || rule.num_steps < count * rule.minimum) {
    throw InvalidArgument(fmt::format("{} steps are fewer than {} for each of {} sessions",
                                      rule.num_steps, rule.minimum, num_parts));
  }
  if (rule.num_steps > count * rule.maximum) {
    throw InvalidArgument(fmt::format("{} steps are more than {} for each of {} sessions",
                                      rule.num_steps, rule.maximum, num_parts));
  }
  const int each = rule.num_steps / static_cast<int>(count);
  std::vector<int> steps(num_parts, each);
  for (int i = 0; i < rule.num_steps - each * static_cast<int>(count); ++i) {
    ++steps[static_cast<std::size_t>(i)];
  }
  Exchanges exchanges(rule, value, steps);
  for (int exchanged = std::max(1, rule.num_steps / 4); exchanged > 0; exchanged /= 2) {
    while (exchanges.make(exchanged)) {
    }
  }
  return steps;
}

}  // namespace proofmass
