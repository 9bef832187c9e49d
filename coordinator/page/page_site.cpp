#include "coordinator/page/page_site.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "coordinator/page/page_views.hpp"

namespace proofmass::coordinator {
namespace {

constexpr std::chrono::seconds turn_interval_max(10);

HttpAnswer text_answer(unsigned status, std::string text) {
  return {.status = status,
          .content_type = "text/plain; charset=utf-8",
          .body = std::move(text) + "\n"};
}

HttpAnswer not_found() { return text_answer(404, "there is nothing at this address"); }

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

bool is_about_workers(const PageRequest& request) { return request.path.back() == "workers"; }

}  // namespace

std::optional<HttpAnswer> PageSite::answer(const HttpRequest& http, Patience patience) const {
  const std::optional<PageRequest> request = parse_target(http.target);
  if (!request) return not_found();
  const std::vector<std::string>& path = request->path;
  if (path.size() == 1 && path[0] == "healthz") return health();
  if (path.empty() && request->has("token")) {
    if (auto welcome = sources_.access.welcome(request->text("token"))) return welcome;
  }
  if (auto refusal = sources_.access.refusal_of(http)) return refusal;
  std::optional<HttpAnswer> given = answer_to_visitor(*request, patience);
  if (given) given->has_shown_token = sources_.access.has_token();
  return given;
}

std::optional<HttpAnswer> PageSite::answer_to_visitor(const PageRequest& request,
                                                      Patience patience) const {
  const std::vector<std::string>& path = request.path;
  if (path.size() == 1) {
    if (auto file = file_answer(path[0])) return file;
  }
  const SnapshotDepth depth = !path.empty() && is_about_workers(request)
                                  ? SnapshotDepth::with_workers
                                  : SnapshotDepth::without_workers;
  std::shared_ptr<const ServiceSnapshot> snapshot = sources_.board->want(depth, sources_.now());
  if (snapshot == nullptr && patience == Patience::left) return std::nullopt;
  if (snapshot == nullptr) snapshot = sources_.board->newest();
  if (snapshot == nullptr) return text_answer(503, "the coordinator has not said anything yet");
  if (auto found = about_service(request, *snapshot)) return found;
  return about_campaign(request, *snapshot);
}

HttpAnswer PageSite::health() const {
  const Duration since_turn = sources_.board->since_turn(sources_.now());
  if (since_turn < turn_interval_max) return text_answer(200, "ok");
  return text_answer(
      503, fmt::format("the service has not come round for {:.0f} s", seconds(since_turn)));
}

std::optional<HttpAnswer> PageSite::about_service(const PageRequest& request,
                                                  const ServiceSnapshot& snapshot) const {
  const std::vector<std::string>& path = request.path;
  const TimePoint now = sources_.now();
  if (path.empty()) return html_answer(request, overview_page(snapshot, request, now));
  if (path.size() == 1 && path[0] == "workers") {
    return html_answer(request, workers_page(snapshot, request, now));
  }
  if (path.size() == 1 && path[0] == "metrics") {
    return HttpAnswer{.content_type = "text/plain; version=0.0.4; charset=utf-8",
                      .body = metrics_text(snapshot, now, process_figures(), sources_.counts())};
  }
  return std::nullopt;
}

HttpAnswer PageSite::about_campaign(const PageRequest& request,
                                    const ServiceSnapshot& snapshot) const {
  if (request.path.size() != 2 || request.path[0] != "campaigns") return not_found();
  const std::string& name = request.path[1];
  const auto& campaigns = snapshot.campaigns;
  const auto found = std::ranges::find(
      campaigns, name,
      [](const CampaignRecord& one) -> const std::string& { return one.status.name(); });
  if (found == campaigns.end()) return not_found();
  const TimePoint now = sources_.now();
  // The page shows what has been read by now. Two seconds later its script asks again.
  return html_answer(request, campaign_page(*found, sources_.details(*found, now), request, now));
}

}  // namespace proofmass::coordinator
