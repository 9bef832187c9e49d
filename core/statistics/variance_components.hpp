#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include "core/statistics/interval.hpp"
#include "core/statistics/moments.hpp"

namespace proofmass {

/// One-way analysis of variance of groups of one size: values that differ between groups with the
/// variance σ_b² and within them with σ_w². The interval of the mean has the group as its unit;
/// those of variances are for normal laws. README.md has the formulas.
struct OneWayAnalysis {
  std::size_t num_groups = 0;
  std::size_t group_size = 0;
  double mean = 0.0;
  std::optional<Interval> mean_interval = {};  ///< By Student's law of the groups' means.
  double between_mean_square = 0.0;            ///< With num_groups − 1 degrees of freedom.
  double within_mean_square = 0.0;             ///< With num_groups (group_size − 1).
  double p_value = 1.0;                        ///< Of F, their ratio, if σ_b = 0.
  double between_deviation = 0.0;              ///< Of σ_b; 0 where F is below 1.
  double within_deviation = 0.0;               ///< Of σ_w.
  double within_share = 0.0;                   ///< σ_w²/(σ_b² + σ_w²).
  /// Of the three above, for normal values that scatter alike in all groups: exact, but for σ_b,
  /// whose interval covers no less in practice [Williams1962]. Of values that scatter by half more
  /// or less from group to group that of σ_w covers some 70 %, that of the share 88 %, not 95 %.
  /// Empty below two groups, or without any variance within.
  std::optional<Interval> between_interval = {}, within_interval = {}, within_share_interval = {};
};

/// Takes groups one by one; memory is fixed.
class GroupedValues {
 public:
  /// @pre group_size > 1.
  explicit GroupedValues(std::size_t group_size) : group_size_(group_size) {}

  /// @pre As many values as the size.
  void add(std::span<const double> group);
  /// @pre At least one group.
  [[nodiscard]] OneWayAnalysis analysis(double confidence) const;

 private:
  std::size_t group_size_;
  std::optional<MomentSums> means_;
  CompensatedSum within_;  ///< Of (value − mean of its group)².
};

/// Of a probability, from the shares of hits in groups of one size, whose members may depend on one
/// another: Clopper-Pearson with the number of independent runs that would have this variance
/// [KornGraubard1998]. Without any variance that is the number of groups where the shares are all 0
/// or 1, and else that of all members.
[[nodiscard]] Interval grouped_probability_interval(const Moments& shares, std::size_t group_size,
                                                    double confidence);

}  // namespace proofmass
