#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "coordinator/net/service_snapshot.hpp"
#include "coordinator/page/campaign_details.hpp"
#include "coordinator/page/page_layout.hpp"
#include "coordinator/page/page_request.hpp"
#include "coordinator/page/snapshot_board.hpp"

namespace proofmass::coordinator {

inline constexpr std::size_t rows_per_page = 50;

/// By what the workers are sorted.
enum class WorkerOrder : std::uint8_t { name, state, throughput };

/// Which workers are shown, and how.
struct WorkerChoice {
  WorkerOrder order = WorkerOrder::name;
  std::string filter = {};  ///< A part of the name or host of those that are shown; empty: all.
  std::size_t page = 1;
};

/// @return What the parameters `sort`, `filter` and `page` say; unknown values count as absent.
[[nodiscard]] WorkerChoice worker_choice(const PageRequest& request);
[[nodiscard]] std::string_view name_of(WorkerOrder order);

/// The workers of one page.
struct ChosenWorkers {
  PageOfList list;
  std::vector<const RegisteredWorker*> workers = {};  ///< Of the snapshot.
};

/// Names come in alphabetical order, the states quarantined, silent, computing, idle, and the
/// largest throughput first. Takes some milliseconds for 10,000 workers.
[[nodiscard]] ChosenWorkers choose_workers(const std::vector<RegisteredWorker>& workers,
                                           const WorkerChoice& choice);

/// Results per hour since the worker registered.
[[nodiscard]] double results_per_h(const RegisteredWorker& worker);

/// The first page: all campaigns, fifty at a time.
[[nodiscard]] PageContent overview_page(const ServiceSnapshot& snapshot, const PageRequest& request,
                                        TimePoint now);
[[nodiscard]] PageContent workers_page(const ServiceSnapshot& snapshot, const PageRequest& request,
                                       TimePoint now);
/// One campaign: `campaigns/NAME`.
/// @param details  Null before they were read for the first time.
[[nodiscard]] PageContent campaign_page(const CampaignRecord& campaign,
                                        const CampaignDetails* details, const PageRequest& request,
                                        TimePoint now);

}  // namespace proofmass::coordinator
