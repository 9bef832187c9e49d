#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "core/statistics/interval.hpp"

namespace proofmass {

/// Share of an output's variance that goes with one input alone (first-order Sobol index),
/// estimated from runs as they are, each with all of its inputs drawn anew: the outputs in the
/// order of the input are compared with their neighbours [GamboaEtAl2022], whose half squared
/// differences are the variance that the input leaves [Rice1984]. The bias goes as 1/n², so that it
/// can be left out from 100 values on.
struct FirstOrderIndex {
  /// 1 − (mean squared half-difference of neighbours)/variance; for an input without influence it
  /// is below 0 as often as above.
  double index = 0.0;
  double standard_error = 0.0;
  Interval interval;  ///< Not symmetric about the index; its lower end may be below 0.
  /// Kruskal and Wallis' test: does the output depend on the input? It looks at ranks only, so it
  /// errs as often as it says whatever the law of the output.
  double p_value = 1.0;
};

/// Below so many values no sensitivity can be told.
inline constexpr std::size_t sensitivity_values_min = 16;

/// How one output depends on one input.
struct Sensitivity {
  std::size_t input = 0;          ///< Index of the column.
  double rank_correlation = 0.0;  ///< Of input and output.
  FirstOrderIndex first_order;
  /// p_value of the index, corrected by holm_adjusted() for all inputs that vary, and for outputs.
  double adjusted_p_value = 1.0;
};

/// A column of values in run order.
using Column = std::span<const double>;

/// For each output, its sensitivity to each input that varies: first those with a corrected p-value
/// below 1 − confidence, by their index, then the others by their p-value. Empty for an output that
/// does not vary. Columns of a campaign: for inputs the drawn_names(), for outputs errors and
/// |errors| of the parameters, over the runs that have an estimate.
///
/// Takes some 0.1 s for a million runs, an input and an output.
///
/// @param num_outputs  That somebody looks at, these among them: p-values are multiplied by it.
/// @throws InvalidArgument if columns differ in size, have too few values or one is not finite.
[[nodiscard]] std::vector<std::vector<Sensitivity>> sensitivities(std::span<const Column> inputs,
                                                                  std::span<const Column> outputs,
                                                                  double confidence,
                                                                  std::size_t num_outputs);

/// The values of an input as factors of products have them: less their mean where chance alone,
/// four standard errors, does not make it. A product with a scale factor that is nearly 1 would be
/// the other factor itself, and that of two quantities about 0 is what makes an error.
[[nodiscard]] std::vector<double> factor_values(Column input);

/// One input, or the product of two by their factor_values(), as a term of a sum that explains an
/// output.
struct ExplanatoryTerm {
  std::size_t first = 0;              ///< Index of the column.
  std::optional<std::size_t> second;  ///< Of the other factor, which may be `first`; empty for one.
  double slope = 0.0;                 ///< Its coefficient in the sum of all terms found.
  double share = 0.0;                 ///< Of the output's variance, beyond the terms before it.
  double p_value = 1.0;               ///< That chance alone explains as much, corrected.
};

/// Searches a sum of few terms that explains an output, a term at a time:
///
/// 1. Of all inputs and all products of two inputs, squares among them, the one with the largest
///    linear correlation with what is left of the output is the candidate.
/// 2. It is kept if its p-value times the number of all inputs and products, and times that of the
///    outputs that somebody looks at, is below 1 − confidence, and it explains at least
///    `term_share_min` of the output's variance. A product must explain more than its factors do:
///    both are fitted linearly and taken from product and output first, as the square of a skewed
///    input goes with the input. If it is not kept, the next one by correlation is asked, of
///    num_term_candidates at most.
/// 3. The output is fitted again by all terms, least squares with a constant, and what is left goes
///    on to 1.
///
/// The test is that of Σab/√Σa²b² with the normal law, a and b being candidate and output, centred,
/// a product's without its factors, and limited to two standard deviations: it holds whatever the
/// laws, also if the scatter of the output goes with the candidate, as it does if both have a
/// factor in common.
///
/// Takes some 2 s for 100,000 values of 70 inputs.
///
/// @throws InvalidArgument if columns differ in size, have below sensitivity_values_min values or
///         one is not finite; confidence must be in (0, 1).
[[nodiscard]] std::vector<ExplanatoryTerm> explanatory_terms(std::span<const Column> inputs,
                                                             Column output, std::size_t num_max,
                                                             double confidence,
                                                             std::size_t num_outputs);

/// The share of an output's variance that a term has to explain to be found by explanatory_terms()
/// in half of all samples of this size. With a the values of a term and b the output, of variance 1
/// and correlation r, ⟨a²b²⟩ = 1 + (k − 1)r² with k = ⟨a⁴⟩, so that the statistic Σab/√Σa²b² is
/// about r√n/√(1 + (k − 1)r²). That is z, which the normal law exceeds with the probability that a
/// candidate is kept at, for r² = z²/(n − (k − 1)z²). k is the mean of the inputs.
///
/// @return At least term_share_min; above 1 if no term would be found so often.
[[nodiscard]] double term_share_found(std::span<const Column> inputs, double confidence,
                                      std::size_t num_outputs);

/// Smallest share of the variance that a term must explain.
inline constexpr double term_share_min = 0.01;

/// Candidates that are asked for each term at most.
inline constexpr std::size_t num_term_candidates = 30;

}  // namespace proofmass
