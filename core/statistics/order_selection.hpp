#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <set>
#include <span>
#include <vector>

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

}  // namespace proofmass
