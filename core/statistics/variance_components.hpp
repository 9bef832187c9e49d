#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/statistics/interval.hpp"
#include "core/statistics/moments.hpp"

namespace proofmass {

/// Fewest groups for an interval of OneWayAnalysis::within_share: from here on it covers at least
/// 93 % in the simulations of README.md, if the centres of the groups are normal.
inline constexpr std::size_t num_groups_min = 10;

/// One-way analysis of variance of groups of one size: values that differ between groups with the
/// variance σ_b² and within them with σ_w², the mean over the groups of the variance in each. No
/// law is assumed, and the unit of all intervals is the group. README.md has the formulas.
struct OneWayAnalysis {
  std::size_t num_groups = 0;
  std::size_t group_size = 0;
  double mean = 0.0;
  std::optional<Interval> mean_interval = {};  ///< By Student's law of the groups' means.
  double within_mean_square = 0.0;  ///< Of σ_w², with num_groups (group_size − 1) degrees.
  double within_deviation = 0.0;    ///< Of σ_w.
  // Empty below two groups.
  std::optional<double> between_mean_square = {};  ///< With num_groups − 1 degrees of freedom.
  std::optional<double> between_deviation = {};    ///< Of σ_b; 0 where its square would be below.
  std::optional<double> within_share = {};  ///< σ_w²/(σ_b² + σ_w²); empty also if both are 0.
  /// By the jackknife over groups. Empty below num_groups_min groups, or if all variance is within
  /// or between one of them.
  std::optional<Interval> within_share_interval = {};
};

/// Takes groups one by one; memory is fixed.
class GroupedValues {
 public:
  /// @pre group_size > 1.
  explicit GroupedValues(std::size_t group_size) : group_size_(group_size) {}

  /// @pre As many values as the size.
  void add(std::span<const double> group);
  /// Without any group all numbers are 0 and all options empty.
  [[nodiscard]] OneWayAnalysis analysis(double confidence) const;

 private:
  /// Groups that the jackknife leaves out together.
  struct Block {
    std::size_t num_groups = 0;
    double sum = 0.0;      ///< Of the groups' means, less centre_.
    double squares = 0.0;  ///< Of the same differences.
    double within = 0.0;   ///< Of (value − mean of its group)².

    Block& operator+=(const Block& other);
  };
  void add_to_blocks(const Block& group);
  [[nodiscard]] double log_ratio(const Block& groups) const;
  [[nodiscard]] std::optional<Interval> share_interval(double confidence) const;

  std::size_t group_size_;
  double centre_ = 0.0;  ///< Mean of the first group.
  std::optional<MomentSums> means_;
  CompensatedSum within_;  ///< Of (value − mean of its group)².
  std::vector<Block> blocks_;
  std::size_t block_size_ = 1;
};

/// Hits among the members of groups of one size, which may depend on one another within a group.
class GroupedHits {
 public:
  explicit GroupedHits(std::uint64_t group_size) : group_size_(group_size) {}

  /// @param num_hits  Members of a group that are hit, at most the size.
  void add(std::uint64_t num_hits);
  /// Of all members. @pre At least one group; so below.
  [[nodiscard]] double share() const;
  /// Of the probability of a hit: Clopper-Pearson with the number of independent members that would
  /// have the variance found between groups [KornGraubard1998]. That number is not known if few
  /// groups have a hit, or few a member without one: then each group counts as one member, as if
  /// either all of its members were hit or none.
  [[nodiscard]] Interval interval(double confidence) const;

 private:
  std::uint64_t group_size_;
  std::uint64_t num_groups_ = 0;
  std::uint64_t num_with_hit_ = 0;   ///< Groups with at least one hit.
  std::uint64_t num_with_miss_ = 0;  ///< Groups with at least one member that is not hit.
  double hits_ = 0.0, squared_hits_ = 0.0;
};

}  // namespace proofmass
