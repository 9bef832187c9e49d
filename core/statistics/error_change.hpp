#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/statistics/comparison.hpp"
#include "core/statistics/moments.hpp"

namespace proofmass {

// Do the errors of two campaigns differ? Three tests: of their location (bias), of their scale
// (scatter about the bias) and of their tail (how many are far out). README.md has their power.

/// Errors of one campaign, with their sign. They are seen in two passes, the same ones in the same
/// order, and not kept: ten million take as much memory as ten.
class ErrorPasses {
 public:
  void add(double error);  ///< In the first pass.
  /// @pre One value at least. @param limit  From tail_limit() of both campaigns.
  void begin_second(double limit);
  void add_again(double error);

  [[nodiscard]] std::size_t count() const { return count_; }
  [[nodiscard]] double mean() const;  ///< After the first pass.
  /// Σx², after the first pass.
  [[nodiscard]] double square_sum() const { return square_sum_.value(); }
  [[nodiscard]] Moments errors() const { return errors_.moments(); }
  [[nodiscard]] Moments deviations() const { return deviations_.moments(); }  ///< Of |x − mean|.
  /// Of |x − mean| − s (x − mean), s being the mean sign of x − mean: the same mean, and the
  /// scatter that the mean of |x − mean| has, as the mean of a skew law moves it.
  [[nodiscard]] Moments scale_moments() const;
  [[nodiscard]] std::size_t num_in_tail() const { return num_in_tail_; }  ///< |x| > limit.

 private:
  std::size_t count_ = 0;
  CompensatedSum sum_;
  CompensatedSum square_sum_;
  double mean_ = 0.0;
  double limit_ = 0.0;
  std::size_t num_in_tail_ = 0;
  MomentSums errors_{0.0};
  MomentSums deviations_{0.0};
  CompensatedSum sign_sum_;           ///< Of x − mean.
  CompensatedSum signed_square_sum_;  ///< Of (x − mean) |x − mean|.
};

/// Where the tail begins: at twice the root mean square of all errors of both campaigns, beyond
/// which 4.6 % of normal ones lie. It is the same whichever errors are whose, so that the counts
/// beyond it follow the hypergeometric law if both campaigns have one law.
[[nodiscard]] double tail_limit(const ErrorPasses& first, const ErrorPasses& second);

/// How probable such differences are by chance alone, two-sided.
struct ChangePValues {
  double location = 1.0;
  double scale = 1.0;
  double tail = 1.0;
};

/// Of campaigns with draws of their own, both passes done: Welch's t of the errors; Welch's t of
/// scale_moments() (Levene's test, with the scatter that holds for skew laws, too); Fisher's exact
/// test of the counts in the tail. README.md compares the second one with others.
/// @pre num_welch_min values on either side.
[[nodiscard]] ChangePValues compare_many_errors(const ErrorPasses& first,
                                                const ErrorPasses& second);

/// Tests fewer values than num_welch_min, at least two on either side: compare_unpaired() of the
/// errors and of |error − mean of both campaigns|. A large change of the bias then shows as one of
/// the scale too.
[[nodiscard]] ChangePValues compare_few_errors(std::span<const double> first,
                                               std::span<const double> second);

/// An error, and the mean of all errors of its campaign.
struct CentredError {
  double error = 0.0;
  double mean = 0.0;
};

/// Of campaigns of the same draws, run by run.
struct PairedErrors {
  /// @param limit  From tail_limit() of both campaigns.
  void add(const CentredError& first, const CentredError& second, double limit);

  std::vector<double> differences;            ///< Second error − first.
  std::vector<double> deviation_differences;  ///< Of |error − mean of its campaign|.
  std::size_t num_only_first = 0;             ///< Pairs of which only the first is in the tail.
  std::size_t num_only_second = 0;
};

/// Wilcoxon's signed ranks of both differences, and the sign test of the pairs of which one error
/// is in the tail (McNemar).
[[nodiscard]] ChangePValues compare_paired_errors(PairedErrors pairs);

/// The smallest factor by which the scatter of the second campaign may be larger and is found with
/// this probability by the test of compare_many_errors(), if the p-values of so many parameters are
/// adjusted together. It gives "no change" a meaning. Empty if no factor is found so.
inline constexpr double finding_probability = 0.9;
[[nodiscard]] std::optional<double> smallest_scale_factor(const ErrorPasses& first,
                                                          const ErrorPasses& second,
                                                          std::size_t num_parameters);
/// The factor that compare_paired_errors() would have found. @param first  The errors of the first
/// campaign.
[[nodiscard]] std::optional<double> smallest_scale_factor(const ErrorPasses& first,
                                                          const PairedErrors& pairs,
                                                          std::size_t num_parameters);

/// Corrects the p-values of all parameters together by holm_adjusted() with weights: location has
/// five tenths, scale four and tail one.
[[nodiscard]] std::vector<ChangePValues> adjusted_changes(std::span<const ChangePValues> changes);

/// P-value of Fisher's exact test: of two groups of `num_first` and `num_second`, of which
/// `tail_first` and `tail_second` are in the tail. Two-sided, by the probabilities that are at most
/// the one of the counts that are seen.
struct TailCounts {
  std::uint64_t num_first = 0;
  std::uint64_t tail_first = 0;
  std::uint64_t num_second = 0;
  std::uint64_t tail_second = 0;
};
[[nodiscard]] double fisher_exact_p_value(const TailCounts& counts);

}  // namespace proofmass
