#pragma once

#include "core/statistics/interval.hpp"

namespace proofmass {

/// Evidence about a probability from `num_hits` events in `num_runs` runs, which may be looked at
/// after every run and as often as one likes.
///
/// Against "the probability is p or more" it is the likelihood of the runs, averaged over the
/// smaller probabilities p′, over their likelihood under p [Robbins1970]:
///
///     M = ∫₀ᵖ w(p′) (p′/p)ᵏ ((1 − p′)/(1 − p))ⁿ⁻ᵏ dp′      w(p′) = 1/(2 √(p p′))
///       = (1 − p) I_p(k + ½, n − k + 1)/(2 P(k + ½, n − k + 1; p))
///
/// with I the regularised incomplete beta function and P(a, b; p) = pᵃ(1 − p)ᵇ/B(a, b). If the
/// probability is p or more, M is a supermartingale that starts at 1: it ever reaches 1/α with
/// probability α at most [Ville1939]. This is what makes stopping at the first M ≥ 1/α sound.
///
/// @param probability  p, in (0, 1).
/// @pre 0 ≤ num_hits ≤ num_runs.
[[nodiscard]] double evidence_of_less(double num_hits, double num_runs, double probability);

/// Evidence against "the probability is p or less", with the weight of the larger ones
/// w(p′) = p′^(−3/2)/(2 (p^(−1/2) − 1)). Without a hit there is none: 1 at most; it is then 0 here.
[[nodiscard]] double evidence_of_more(double num_hits, double num_runs, double probability);

/// What the evidence leaves: with this confidence the probability is never below any lower bound
/// of the sequence of runs, and with the same confidence never above any upper one. Each bound is
/// one-sided.
///
/// @pre num_runs > 0. @throws InvalidArgument unless 0 < confidence < 1.
[[nodiscard]] Interval sequential_bounds(double num_hits, double num_runs, double confidence);

}  // namespace proofmass
