#pragma once

#include <functional>
#include <limits>
#include <span>
#include <vector>

namespace proofmass {

/// What is to be distributed over the parts of a plan.
struct AllocationRule {
  int num_steps = 0;                              ///< In all.
  int minimum = 1;                                ///< Of each part.
  int maximum = std::numeric_limits<int>::max();  ///< Of each part.
};

/// The steps of each part that make a value largest, by exchange of steps between two parts until
/// no exchange of a single one is a gain. If the value is a sum of concave functions of one part
/// each, that is the best allocation. If the parts share in the value it is nearly the best:
/// several exchanges at once may still be a gain of the second order in a step.
///
/// @param value       Of the steps of each part, ≥ 1: concave, or −∞. Called some tens of times a
///                    part.
/// @param is_stopped  Asked before each exchange. Once it is true the search ends with the best
///                    allocation so far, of the equal parts that it begins with at worst.
/// @throws InvalidArgument if the parts need more than `num_steps`, or cannot hold them.
[[nodiscard]] std::vector<int> allocate(
    std::size_t num_parts, const AllocationRule& rule,
    const std::function<double(std::span<const int>)>& value,
    const std::function<bool()>& is_stopped = [] { return false; });

}  // namespace proofmass
