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
  double before = 0.0;  ///< Rise by the part's last step.
  double after = 0.0;   ///< Rise by one step more.

  [[nodiscard]] double middle() const { return 0.5 * (before + after); }
};

/// a − b, also of equal infinities.
double difference(double a, double b) { return a == b ? 0.0 : a - b; }

class Exchanges {
 public:
  Exchanges(const AllocationRule& rule, const std::function<double(std::span<const int>)>& value,
            const std::function<bool()>& is_stopped, std::vector<int>& steps)
      : rule_(rule),
        value_(value),
        is_stopped_(is_stopped),
        steps_(steps),
        best_(value(steps)),
        slopes_(steps.size()) {}

  /// Exchanges so many steps between two parts for as long as that is a gain; false if it is none
  /// for any two, or if the search is stopped.
  bool make(int count) {
    if (try_exchange(count)) return true;
    if (are_slopes_new_ || is_stopped_()) return false;
    for (std::size_t i = 0; i < steps_.size(); ++i) slopes_[i] = slopes_of(i);
    are_slopes_new_ = true;
    return try_exchange(count);
  }

 private:
  /// Tries those first that promise most. Slopes from before other exchanges say nothing for
  /// certain, but a promise is worth a try.
  bool try_exchange(int count) {
    std::vector<std::size_t> order(steps_.size());  // Of rising slope.
    std::iota(order.begin(), order.end(), 0U);
    std::ranges::stable_sort(order, {}, [&](std::size_t i) { return slopes_[i].middle(); });
    for (auto to = order.rbegin(); to != order.rend(); ++to) {
      for (const std::size_t from : order) {
        if (from == *to || slopes_[*to].before <= slopes_[from].after) continue;
        if (!is_possible(from, *to, count)) continue;
        if (gain(from, *to, count)) {
          while (gain(from, *to, count)) {
          }
          slopes_[from] = slopes_of(from);
          slopes_[*to] = slopes_of(*to);
          are_slopes_new_ = false;
          return true;
        }
        if (!are_slopes_new_) return false;
      }
    }
    return false;
  }

  [[nodiscard]] Slopes slopes_of(std::size_t i) {
    Slopes slopes{.before = std::numeric_limits<double>::infinity(), .after = 0.0};
    ++steps_[i];
    slopes.after = difference(value_(steps_), best_);
    --steps_[i];
    if (steps_[i] == 1) return slopes;
    --steps_[i];
    slopes.before = difference(best_, value_(steps_));
    ++steps_[i];
    return slopes;
  }

  [[nodiscard]] bool is_possible(std::size_t from, std::size_t to, int count) const {
    return steps_[from] - count >= rule_.minimum && steps_[to] <= rule_.maximum - count;
  }

  /// Exchanges steps if that is a gain.
  bool gain(std::size_t from, std::size_t to, int count) {
    if (!is_possible(from, to, count) || is_stopped_()) return false;
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
  const std::function<bool()>& is_stopped_;
  std::vector<int>& steps_;
  double best_;
  std::vector<Slopes> slopes_;
  bool are_slopes_new_ = false;  ///< All are those at `steps_`.
};

}  // namespace

std::vector<int> allocate(std::size_t num_parts, const AllocationRule& rule,
                          const std::function<double(std::span<const int>)>& value,
                          const std::function<bool()>& is_stopped) {
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
  Exchanges exchanges(rule, value, is_stopped, steps);
  for (int exchanged = std::max(1, rule.num_steps / 4); exchanged > 0; exchanged /= 2) {
    while (exchanges.make(exchanged)) {
    }
  }
  return steps;
}

}  // namespace proofmass
