#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "coordinator/table/table.hpp"
#include "proto/wire/client_codec.hpp"

namespace proofmass::coordinator {

// What people are shown of a coordinator and its campaigns: the counts, and a line of visible text
// for everything that is out of the ordinary.

/// A number of runs or results in CampaignStatus.
struct CampaignCounter {
  std::string_view name;  ///< Of the field of the message, and of the key in JSON.
  std::uint64_t (proto::CampaignStatus::*count)() const;
  std::string_view metric;  ///< Name in `/metrics`: a counter if it ends in `_total`.
  std::string_view help;    ///< What `/metrics` says of it.
};

/// All of them: JSON and metrics have what this has. A new one needs its field in client.proto, a
/// row in status_notes.cpp, its count in CampaignState, and CampaignService::record_of().
[[nodiscard]] std::span<const CampaignCounter> campaign_counters();

/// `and 3 more workers`; empty if all of `count` are shown.
[[nodiscard]] std::string further_note(std::uint64_t count, int num_shown, std::string_view thing);

[[nodiscard]] std::uint64_t percent_done(const proto::CampaignStatus& campaign);

/// True if it is finished or cancelled.
[[nodiscard]] bool is_over(const proto::CampaignStatus& campaign);

/// Runs a second, and the time until all are finished; a dash where it is not known.
[[nodiscard]] std::string rate_text(const proto::CampaignStatus& campaign);
[[nodiscard]] std::string time_left_text(const proto::CampaignStatus& campaign);

/// The columns of a table of campaigns, with widths for a terminal, and one of its rows.
[[nodiscard]] std::vector<Column> campaign_columns();
[[nodiscard]] Row campaign_row(const proto::CampaignStatus& campaign);

/// `Proofmass 0.9, models a-1, b-2, up 3 min 20 s`; the built-in model if no other is known.
/// @param versions  Of the campaigns' models; empty for one that an older coordinator serves.
[[nodiscard]] std::string service_line(const proto::StatusReply& status,
                                       std::set<std::string> versions);

[[nodiscard]] std::vector<Remark> notes_about(const proto::CampaignStatus& campaign);

/// About the coordinator itself: files that are not served, refused workers, hosts in quarantine,
/// factories.
[[nodiscard]] std::vector<Remark> service_notes(const proto::StatusReply& status);

// How a coordinator stands, for programs: JSON objects with stable keys, units in their names.

[[nodiscard]] nlohmann::ordered_json status_json(const proto::StatusReply& status);
[[nodiscard]] nlohmann::ordered_json workers_json(const proto::WorkersReply& workers);

}  // namespace proofmass::coordinator
