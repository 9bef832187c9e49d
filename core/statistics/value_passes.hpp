#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <vector>

#include "core/statistics/bootstrap.hpp"
#include "core/statistics/interval.hpp"
#include "core/statistics/moments.hpp"
#include "core/statistics/order.hpp"

namespace proofmass {

/// Values that one OrderSelection keeps at most, 8 MB.
inline constexpr std::size_t num_selected_max = std::size_t{1} << 20;

/// Values at some places in ascending order, of values that are too many to be kept: they are seen
/// in several passes, the same ones each time.
///
/// The first pass counts values by the upper 20 bits of their position among all doubles (4 MB).
/// After it the places are known to within 0.4 % of their value. Each further pass either keeps the
/// values that share those bits with a place, and is the last, or counts them by their next 12
/// bits. Two passes do for some 10⁷ values of a smooth law, and six for any.
class OrderSelection {
 public:
  OrderSelection();

  void add(double value);  ///< @pre Not a NaN.

  /// Ends the first pass.
  /// @param places  Those that are wanted, from 0; below the number of values.
  /// @return True if another pass is needed.
  [[nodiscard]] bool end_first_pass(const std::set<std::size_t>& places);
  /// Ends a later one.
  [[nodiscard]] bool end_pass();

  /// @pre It is one of the places, and no pass is needed any more.
  [[nodiscard]] double value_at(std::size_t place) const { return values_.at(place); }

 private:
  /// Values whose position has the same upper bits.
  struct Bin {
    std::uint64_t upper_bits = 0;
    std::uint64_t num_below = 0;  ///< Values in all bins below.
    std::uint64_t count = 0;
    std::vector<std::size_t> places;  ///< Wanted ones, all of them in this bin.
    bool is_kept = false;             ///< By value, rather than counted by the next bits.
    std::vector<double> values;
    std::vector<std::uint32_t> counts;
  };

  void begin_pass(std::vector<Bin> bins);
  static void split(const Bin& parent, std::span<const std::uint32_t> counts, int num_next_bits,
                    std::vector<Bin>& bins);

  bool is_first_ = true;
  int shift_;                          ///< Bits below those that are counted or that bins share.
  std::vector<std::uint32_t> counts_;  ///< Of the first pass.
  std::vector<Bin> bins_;              ///< Of a later one, ascending.
  std::map<std::size_t, double> values_;
};

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
