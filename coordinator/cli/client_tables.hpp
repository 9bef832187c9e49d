#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "proto/wire/client_messages.hpp"

namespace proofmass::coordinator {

// What a coordinator replied, for people. Tables take 79 columns, and more if names are long and
// `line_width_max` has room for them; notes that quote a failure take what they need.

/// True if it is finished or cancelled.
[[nodiscard]] bool is_over(const wire::CampaignStatus& campaign);

/// A line about the coordinator, a row a campaign, and notes about what is out of the ordinary.
[[nodiscard]] std::string status_table(const wire::StatusReply& status, std::size_t line_width_max);

/// A row a worker, and notes about those that are lent nothing.
[[nodiscard]] std::string workers_table(const wire::WorkersReply& workers,
                                        std::size_t line_width_max);

/// `hardy2013 active: 42 of 100 runs, 42 %, 0.500 runs/s, 1 min 56 s left`, and the notes.
[[nodiscard]] std::string campaign_line(const wire::CampaignStatus& campaign);

}  // namespace proofmass::coordinator
