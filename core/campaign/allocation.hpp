#pragma once

#include <functional>
#include <span>
#include <vector>

namespace proofmass {

/// What is to be distributed over the parts of a plan.
struct AllocationRule {
  int num_steps = 0;  ///< In all.
  int minimum = 1;    ///< Of each part.
};

/// The steps of each part that make a value largest, by exchange of steps between two parts until
/// no exchange of a single one is a gain. Of what grows smoothly with concave returns that is
/// nearly the best allocation: several exchanges at once may still be a gain of the second order in
/// a step.
///
/// @param value  Of the steps of each part: an increasing function of a concave one.
/// @throws InvalidArgument if the parts need more than `num_steps`.
[[nodiscard]] std::vector<int> allocate(std::size_t num_parts, const AllocationRule& rule,
                                        const std::function<double(std::span<const int>)>& value);

}  // namespace proofmass
