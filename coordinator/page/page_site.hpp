#pragma once

#include <functional>
#include <optional>
#include <string>

#include "coordinator/page/campaign_details.hpp"
#include "coordinator/page/http_server.hpp"
#include "coordinator/page/metrics.hpp"
#include "coordinator/page/page_access.hpp"
#include "coordinator/page/page_request.hpp"
#include "coordinator/page/snapshot_board.hpp"

namespace proofmass::coordinator {

/// What the answers of a page are made of; all but the access may be called from its thread only.
struct SiteSources {
  PageAccess access{std::nullopt};
  SnapshotBoard* board = nullptr;  ///< Outlives the site; not null.
  /// As DetailReader::details().
  std::function<CampaignDetails(const CampaignRecord&, TimePoint)> details;
  std::function<HttpCounts()> counts;  ///< Of the server.
  std::function<TimePoint()> now;      ///< Steady clock.
};

/// Which address has which answer. README.md lists them.
class PageSite {
 public:
  explicit PageSite(SiteSources sources) : sources_(std::move(sources)) {}

  /// As HttpServer::Handler.
  [[nodiscard]] std::optional<HttpAnswer> answer(const HttpRequest& request,
                                                 HttpServer::Patience patience) const;

 private:
  using Patience = HttpServer::Patience;

  [[nodiscard]] HttpAnswer health() const;
  /// To somebody who may see the page.
  [[nodiscard]] std::optional<HttpAnswer> answer_to_visitor(const PageRequest& request,
                                                            Patience patience) const;
  [[nodiscard]] std::optional<HttpAnswer> about_service(const PageRequest& request,
                                                        const ServiceSnapshot& snapshot) const;
  [[nodiscard]] HttpAnswer about_campaign(const PageRequest& request,
                                          const ServiceSnapshot& snapshot) const;

  SiteSources sources_;
};

}  // namespace proofmass::coordinator
