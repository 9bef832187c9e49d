#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "coordinator/table/table.hpp"
#include "proto/wire/client_messages.hpp"

namespace proofmass::coordinator {

// What is out of the ordinary about a coordinator, in lines for people: visible text.

/// `1 run`, `2 runs`.
[[nodiscard]] std::string counted(std::uint64_t count, std::string_view thing);

/// `and 3 more workers`; empty if all of `count` are shown.
[[nodiscard]] std::string further_note(std::uint64_t count, std::size_t num_shown,
                                       std::string_view thing);

/// Of the campaign's runs.
[[nodiscard]] std::uint64_t percent_done(const wire::CampaignStatus& campaign);

/// About a campaign.
[[nodiscard]] std::vector<Remark> notes_about(const wire::CampaignStatus& campaign);

/// About the coordinator itself: files that are not served, hosts in quarantine, factories.
[[nodiscard]] std::vector<Remark> service_notes(const wire::StatusReply& status);

}  // namespace proofmass::coordinator
