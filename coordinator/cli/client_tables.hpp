#pragma once

#include <string>
#include <string_view>

#include "proto/wire/client_messages.hpp"

namespace proofmass::coordinator {

// What a coordinator replied, for people: at most 79 columns, but for notes that quote a failure.

/// A line about the coordinator, a row a campaign, and notes about what is out of the ordinary.
[[nodiscard]] std::string status_table(const wire::StatusReply& status);

/// A row a worker, and notes about those that are lent nothing.
[[nodiscard]] std::string workers_table(const wire::WorkersReply& workers);

/// `hardy2013 active: 42 of 100 runs, 42 %, 0.500 runs/s, 1 min 56 s left`, and the notes.
[[nodiscard]] std::string campaign_line(const wire::CampaignStatus& campaign);

}  // namespace proofmass::coordinator
