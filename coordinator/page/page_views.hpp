#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "coordinator/charts/chart.hpp"
#include "coordinator/net/service_snapshot.hpp"
#include "coordinator/page/campaign_details.hpp"
#include "coordinator/page/http_server.hpp"
#include "coordinator/page/page_access.hpp"
#include "coordinator/store/records.hpp"
#include "coordinator/table/table.hpp"

namespace proofmass::coordinator {

/// The parts of a page of the live page.
struct PageContent {
  std::string title = {};    ///< Plain text; becomes the heading, too.
  std::string to_root = "";  ///< From the page's address to the first page: ``, or `../`.
  std::string form = "";     ///< Markup above `live`, which the script does not exchange.
  std::string live = {};     ///< Markup that the script exchanges every two seconds.
};

[[nodiscard]] std::string whole_page(const PageContent& content);

/// Part of a list that is shown: pages count from 1.
struct PageOfList {
  std::size_t page = 1;
  std::size_t num_pages = 1;
  std::size_t first = 0;  ///< Index of the first item shown.
  std::size_t end = 0;    ///< One beyond the last.
  std::size_t count = 0;  ///< Of all.
};

/// The page that was asked for, of 50 items, or the last one if there are not so many.
[[nodiscard]] PageOfList page_of_list(std::size_t page, std::size_t count);

/// `showing 1–50 of 10,000 workers`, and links to the first, previous, next and last page.
/// @param address  Of a page, without its number: `workers?sort=name&amp;page=`; markup.
[[nodiscard]] std::string list_navigation(const PageOfList& list, std::string_view things,
                                          std::string_view address);

/// A bar of the finished runs with its percentage in words.
/// @param name  Of the bar, for screen readers.
[[nodiscard]] std::string progress_bar(const proto::CampaignStatus& campaign,
                                       std::string_view name);

/// A name with what it has, as a part of a `<dl>`.
[[nodiscard]] std::string fact(std::string_view name, std::string_view value);

/// A list of notes; nothing if there are none.
[[nodiscard]] std::string notes_list(const std::vector<Remark>& notes);

/// The style sheet and the script of all pages; nothing of another name.
[[nodiscard]] std::optional<HttpAnswer> file_answer(std::string_view name);

enum class WorkerOrder : std::uint8_t { name, state, throughput };

struct WorkerChoice {
  WorkerOrder order = WorkerOrder::name;
  std::string filter = {};  ///< A part of the name or host of those that are shown; empty: all.
  std::size_t page = 1;
};

struct ChosenWorkers {
  PageOfList list;
  std::vector<const RegisteredWorker*> workers = {};  ///< Of the snapshot.
};

/// Names come in alphabetical order, the states quarantined, silent, computing, idle, and the
/// largest throughput first. Takes some milliseconds for 10,000 workers.
[[nodiscard]] ChosenWorkers choose_workers(const std::vector<RegisteredWorker>& workers,
                                           const WorkerChoice& choice);

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

/// All attempts, worker by worker, in lanes in which they do not overlap: a lane is about one of
/// the worker's threads, the newest bar first. The database knows the second in which results came,
/// so that a bar may end up to a second before. A worker's first lane has its name and its losses.
/// @param last_s  Since 1970; times are from then on, and mostly below 0.
[[nodiscard]] std::vector<TimelineLane> lanes_of(const RecentAttempts& attempts, double last_s);

/// A timeline of the newest attempts of each worker as SVG: at most half an hour and 24 lanes; how
/// many lanes are left out is said.
[[nodiscard]] std::string attempts_chart(const RecentAttempts& attempts);

}  // namespace proofmass::coordinator
