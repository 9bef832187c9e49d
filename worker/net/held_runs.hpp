#pragma once

#include <compare>
#include <cstddef>
#include <vector>

#include "proto/wire/messages.hpp"

namespace proofmass::worker {

/// A run that the worker holds, ordered as messages name them.
struct HeldRun {
  wire::CampaignId campaign;
  wire::Attempt attempt;
  RunIndex run;

  auto operator<=>(const HeldRun&) const = default;
};

/// The same runs by campaign and attempt, with the first `num_ranges_max` of their ranges.
/// @param runs  In any order, each once.
[[nodiscard]] std::vector<wire::HeldRuns> grouped(std::vector<HeldRun> runs,
                                                  std::size_t num_ranges_max);

/// Ranges of all of them together.
[[nodiscard]] std::size_t num_ranges(const std::vector<wire::HeldRuns>& held);

}  // namespace proofmass::worker
