#pragma once

#include <functional>
#include <memory>
#include <optional>

#include "coordinator/page/campaign_details.hpp"
#include "coordinator/page/http_server.hpp"
#include "coordinator/page/page_access.hpp"
#include "coordinator/page/snapshot_board.hpp"

namespace proofmass::coordinator {

/// Which address has which answer; README.md lists them. All members but the access may be used
/// from the thread of the page only.
struct PageSite {
  PageAccess access{std::nullopt};
  SnapshotBoard* board = nullptr;  ///< Outlives the site; not null.
  /// As DetailReader::details().
  std::function<std::shared_ptr<const CampaignDetails>(const CampaignRecord&, TimePoint)> details;
  std::function<HttpCounts()> counts;  ///< Of the server.
  std::function<TimePoint()> now;      ///< Steady clock.

  /// As HttpServer::Handler.
  [[nodiscard]] std::optional<HttpAnswer> answer(const HttpRequest& request,
                                                 HttpServer::Patience patience) const;
};

}  // namespace proofmass::coordinator
