#pragma once

#include <array>
#include <cstdint>
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

/// All of them: JSON and metrics have what stands here. A new one needs its field in client.proto,
/// a row here, its count in CampaignState, and CampaignService::record_of().
inline constexpr std::array campaign_counters{
    CampaignCounter{"num_runs", &proto::CampaignStatus::num_runs, "proofmass_runs_wanted",
                    "Runs that the campaign is to have."},
    CampaignCounter{"num_done", &proto::CampaignStatus::num_done, "proofmass_runs_finished_total",
                    "Runs whose results are on disk."},
    CampaignCounter{"num_without_estimate", &proto::CampaignStatus::num_without_estimate,
                    "proofmass_runs_without_estimate_total",
                    "Runs that ended without an estimate since the coordinator started."},
    CampaignCounter{"num_given_up", &proto::CampaignStatus::num_given_up, "proofmass_runs_given_up",
                    "Runs that crashed too many workers."},
    CampaignCounter{"num_lent", &proto::CampaignStatus::num_lent, "proofmass_runs_lent",
                    "Runs that workers hold."},
    CampaignCounter{"num_duplicates", &proto::CampaignStatus::num_duplicates,
                    "proofmass_results_duplicate_total", "Results that were there already."},
    CampaignCounter{"num_audited", &proto::CampaignStatus::num_audited,
                    "proofmass_results_compared_total",
                    "Results that were compared with a second computation."},
    CampaignCounter{"num_mismatches", &proto::CampaignStatus::num_mismatches,
                    "proofmass_results_different_total",
                    "Compared results that differ; must be 0."},
};

/// `1 run`, `2 runs`.
[[nodiscard]] std::string counted(std::uint64_t count, std::string_view thing);

/// `and 3 more workers`; empty if all of `count` are shown.
[[nodiscard]] std::string further_note(std::uint64_t count, int num_shown, std::string_view thing);

/// Of the campaign's runs.
[[nodiscard]] std::uint64_t percent_done(const proto::CampaignStatus& campaign);

/// About a campaign.
[[nodiscard]] std::vector<Remark> notes_about(const proto::CampaignStatus& campaign);

/// About the coordinator itself: files that are not served, hosts in quarantine, factories.
[[nodiscard]] std::vector<Remark> service_notes(const proto::StatusReply& status);

}  // namespace proofmass::coordinator
