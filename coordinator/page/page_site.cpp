#include "coordinator/page/page_site.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "coordinator/page/metrics.hpp"
#include "coordinator/page/page_request.hpp"
#include "coordinator/page/page_views.hpp"

namespace proofmass::coordinator {
namespace {

constexpr std::chrono::seconds turn_interval_max(10);

using Patience = HttpServer::Patience;

HttpAnswer not_found() { return plain_answer(404, "there is nothing at this address"); }

/// The page, or only what the script exchanges.
HttpAnswer html_answer(const PageRequest& request, const PageContent& content) {
  return {.body = request.has("fragment") ? content.live : whole_page(content)};
}

std::optional<HttpAnswer> file_answer(const std::string& name) {
  if (name == "style.css") {
    return HttpAnswer{.content_type = "text/css; charset=utf-8", .body = page_style()};
  }
  if (name == "script.js") {
    return HttpAnswer{.content_type = "text/javascript; charset=utf-8",
                      .body = std::string(page_script())};
  }
  return std::nullopt;
}

HttpAnswer health(Duration since_turn) {
  if (since_turn < turn_interval_max) return plain_answer(200, "ok");
  return plain_answer(
      503, fmt::format("the service has not come round for {:.0f} s", seconds(since_turn)));
}

HttpAnswer about_campaign(const PageSite& site, const PageRequest& request,
                          const ServiceSnapshot& snapshot) {
  const std::string& name = request.path[1];
  const auto& campaigns = snapshot.campaigns;
  const auto found = std::ranges::find(
      campaigns, name,
      [](const CampaignRecord& one) -> const std::string& { return one.status.name(); });
  if (found == campaigns.end()) return not_found();
  const TimePoint now = site.now();
  // The page shows what has been read by now. Two seconds later its script asks again.
  return html_answer(request, campaign_page(*found, site.details(*found, now).get(), request, now));
}

HttpAnswer answer_of(const PageSite& site, const PageRequest& request,
                     const ServiceSnapshot& snapshot) {
  const std::vector<std::string>& path = request.path;
  const TimePoint now = site.now();
  if (path.empty()) return html_answer(request, overview_page(snapshot, request, now));
  if (path.size() == 1 && path[0] == "workers") {
    return html_answer(request, workers_page(snapshot, request, now));
  }
  if (path.size() == 1 && path[0] == "metrics") {
    return {.content_type = "text/plain; version=0.0.4; charset=utf-8",
            .body = metrics_text(snapshot, now, process_figures(), site.counts())};
  }
  if (path.size() == 2 && path[0] == "campaigns") return about_campaign(site, request, snapshot);
  return not_found();
}

/// To somebody who may see the page.
std::optional<HttpAnswer> answer_to_visitor(const PageSite& site, const PageRequest& request,
                                            Patience patience) {
  const std::vector<std::string>& path = request.path;
  if (path.size() == 1) {
    if (auto file = file_answer(path[0])) return file;
  }
  const SnapshotDepth depth = !path.empty() && path.back() == "workers"
                                  ? SnapshotDepth::with_workers
                                  : SnapshotDepth::without_workers;
  std::shared_ptr<const ServiceSnapshot> snapshot = site.board->want(depth, site.now());
  if (snapshot == nullptr && patience == Patience::left) return std::nullopt;
  if (snapshot == nullptr) snapshot = site.board->newest();
  if (snapshot == nullptr) return plain_answer(503, "the coordinator has not said anything yet");
  return answer_of(site, request, *snapshot);
}

}  // namespace

std::optional<HttpAnswer> PageSite::answer(const HttpRequest& http, Patience patience) const {
  const std::optional<PageRequest> request = parse_target(http.target);
  if (!request) return not_found();
  const std::vector<std::string>& path = request->path;
  if (path.size() == 1 && path[0] == "healthz") return health(board->since_turn(now()));
  if (path.empty() && request->has("token")) {
    if (auto welcome = access.welcome(request->text("token"))) return welcome;
  }
  if (auto refusal = access.refusal_of(http)) return refusal;
  std::optional<HttpAnswer> given = answer_to_visitor(*this, *request, patience);
  if (given) given->has_shown_token = access.has_token();
  return given;
}

}  // namespace proofmass::coordinator
