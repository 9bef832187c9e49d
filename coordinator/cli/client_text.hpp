#pragma once

#include <string>
#include <string_view>

#include "coordinator/report/status_json.hpp"
#include "coordinator/table/terminal_table.hpp"
#include "proto/wire/client_messages.hpp"

namespace proofmass::coordinator {

// What a coordinator replied, for people.

/// True if it is finished or cancelled.
[[nodiscard]] bool is_over(const wire::CampaignStatus& campaign);

/// Two lines about the coordinator, a row a campaign, and lines about what is out of the ordinary.
[[nodiscard]] std::string status_text(const wire::StatusReply& status, const TerminalStyle& style);

/// A row a worker, and lines about those that are lent nothing.
[[nodiscard]] Table workers_table(const wire::WorkersReply& workers);

/// `mine active: 42 of 100 runs, 42 %, 0.500 runs/s, 1 min 56 s left`, and the notes.
[[nodiscard]] std::string campaign_line(const wire::CampaignStatus& campaign);

// What a coordinator replied, for programs; coordinator/report/status_json.hpp has the rest.

/// @param action    What was asked for: `pause`, `submit`.
/// @param campaign  Its name.
[[nodiscard]] std::string done_json(std::string_view action, std::string_view campaign,
                                    const wire::DoneReply& done);
[[nodiscard]] std::string released_json(std::string_view host, const wire::DoneReply& done);

}  // namespace proofmass::coordinator
