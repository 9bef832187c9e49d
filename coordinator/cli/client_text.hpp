#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "coordinator/report/status_json.hpp"
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

/// `mine active: 42 of 100 runs, 42 %, 0.500 runs/s, 1 min 56 s left`, and the notes.
[[nodiscard]] std::string campaign_line(const wire::CampaignStatus& campaign);

// What a coordinator replied, for programs; coordinator/report/status_json.hpp has the rest.

/// @param action    What was asked for: `pause`, `submit`.
/// @param campaign  Its name.
[[nodiscard]] std::string done_json(std::string_view action, std::string_view campaign,
                                    const wire::DoneReply& done);
[[nodiscard]] std::string released_json(std::string_view host, const wire::DoneReply& done);

}  // namespace proofmass::coordinator
