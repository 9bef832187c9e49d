#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <vector>

#include "core/statistics/bootstrap.hpp"
#include "core/statistics/interval.hpp"
#include "core/statistics/moments.hpp"
#include "core/statistics/order.hpp"
#include "core/statistics/order_selection.hpp"
#include "core/statistics/sum.hpp"

namespace proofmass {

/// Up to so many values one pass is enough, as they are kept: 0.5 MB.
inline constexpr std::size_t num_passed_values_kept = std::size_t{1} << 16;

/// Statistics of values that are too many to be kept. They are seen in several passes, the same
/// ones in the same order each time, and the results are those of moments(), percentile(),
/// percentile_interval() and bootstrap_deviation_interval(), to the last bit. Memory does not grow
/// with their number: it is 12 MB at most.
///
///     do {
///       for (const double value : values) passes.add(value);
///     } while (passes.end_pass());
class ValuePasses {
 public:
  /// What is wanted beside the moments.
  struct Wanted {
    std::vector<double> levels = {};      ///< Of percentiles and their intervals, in (0, 1).
    bool has_deviation_interval = false;  ///< By the bootstrap.
  };

  /// @param num_kept_max  Values that are kept; for tests.
  explicit ValuePasses(Wanted wanted, std::size_t num_kept_max = num_passed_values_kept);

  /// @throws InvalidArgument if the value is not finite.
  void add(double value);
  /// @return True if another pass is needed. @throws InvalidArgument if it had other values.
  [[nodiscard]] bool end_pass();

  // What follows needs that no further pass is needed.

  [[nodiscard]] std::size_t count() const { return count_; }
  [[nodiscard]] double largest() const { return largest_; }  ///< @pre count() ≥ 1; so do all below.
  [[nodiscard]] const Moments& moments() const { return moments_; }
  /// Of the standard deviation, default_confidence; empty below three values.
  [[nodiscard]] const std::optional<Interval>& deviation_interval() const {
    return deviation_interval_;
  }
  /// @param level  One of the wanted ones, as it was given.
  [[nodiscard]] double percentile(double level) const;
  [[nodiscard]] std::optional<Interval> percentile_interval(double level) const;

 private:
  /// Places whose values a percentile is made of.
  struct Places {
    OrderPlace value;
    std::optional<IntervalPlaces> interval;
  };

  void end_first_pass();
  void add_to_sums(double value);
  void end_sums();
  void find_places();
  [[nodiscard]] double value_at(const OrderPlace& place) const;

  Wanted wanted_;
  std::size_t num_kept_max_;
  std::size_t num_passes_ = 0;
  std::size_t num_in_pass_ = 0;

  // First pass.
  std::vector<double> kept_;  ///< All values while they are few; ascending at the end.
  bool are_kept_ = true;
  std::size_t count_ = 0;
  double largest_ = 0.0;
  CompensatedSum sum_;

  // Second pass.
  std::optional<MomentSums> sums_;
  std::optional<BootstrapGroups> groups_;
  Moments moments_;
  std::optional<Interval> deviation_interval_;

  // All passes.
  std::optional<OrderSelection> selection_;
  std::map<double, Places> places_;
};

}  // namespace proofmass
