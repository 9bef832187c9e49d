#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "coordinator/page/campaign_details.hpp"
#include "coordinator/page/page_views.hpp"
#include "coordinator/page/snapshot_board.hpp"

namespace proofmass::coordinator {

// What the page tells programs: JSON objects whose keys README.md documents. `api_version` changes
// if one of them changes its meaning or goes.

inline constexpr int page_api_version = 1;
inline constexpr std::size_t events_per_answer_max = 1000;

[[nodiscard]] std::string status_answer(const PageSnapshot& snapshot, TimePoint now);
[[nodiscard]] std::string workers_answer(const PageSnapshot& snapshot, const PageRequest& request,
                                         TimePoint now);
[[nodiscard]] std::string campaign_answer(const CampaignSnapshot& campaign,
                                          const CampaignDetails& details, TimePoint now);
/// Events after the one with the number of the parameter `after`, or from the oldest one known.
/// @pre The events have been read.
[[nodiscard]] std::string events_answer(const CampaignDetails& details, const PageRequest& request,
                                        std::string_view campaign);

}  // namespace proofmass::coordinator
