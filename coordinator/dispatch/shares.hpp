#pragma once

#include <cstdint>

#include "coordinator/dispatch/state.hpp"

namespace proofmass::coordinator::detail {

// How much of a campaign a worker is to be lent.

[[nodiscard]] constexpr std::uint64_t ratio_rounded_up(std::uint64_t a, std::uint64_t b) {
  return (a + b - 1) / b;
}

/// Runs that a worker lacks, and the slots that they are for.
struct Share {
  std::uint64_t num_runs = 0;
  std::uint64_t num_slots = 0;

  /// Of the slots, for so many of the runs.
  [[nodiscard]] std::uint64_t slots_for(std::uint64_t count) const {
    return ratio_rounded_up(count * num_slots, num_runs);
  }
};

/// What a worker's processors are to be lent of a campaign; nothing if they have enough.
[[nodiscard]] Share share_of_processors(State& state, CampaignId id, const CampaignState& campaign,
                                        const Worker& worker, TimePoint now);

/// What a worker's cards are to be lent of a campaign. They hold their part of all that is not
/// finished, so that everybody finishes together: a round until their speed is known, and then two
/// at most. A few runs take a card as long as many, so that what idle processors have room for is
/// left to them.
[[nodiscard]] Share share_of_cards(const State& state, CampaignId id, const CampaignState& campaign,
                                   const Worker& worker);

}  // namespace proofmass::coordinator::detail
