#include "coordinator/page/page_site.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <span>

#include "coordinator/page/attempts_chart.hpp"
#include "coordinator/page/page_json.hpp"
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

HttpAnswer json_answer(std::string body) {
  return {.content_type = "application/json", .body = std::move(body)};
}

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

/// The path behind `first`, joined again; nothing if it does not begin so.
bool begins_with(const PageRequest& request, std::span<const std::string_view> first) {
  return request.path.size() >= first.size() &&
         std::equal(first.begin(), first.end(), request.path.begin());
}

bool is_about_workers(const PageRequest& request) { return request.path.back() == "workers"; }

HttpAnswer campaign_html(const CampaignSnapshot& campaign, const CampaignDetails& details,
                         const PageRequest& request, TimePoint now) {
  return html_answer(request, campaign_page(campaign, details, request, now));
}

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
  std::shared_ptr<const PageSnapshot> snapshot = sources_.board->want(depth, sources_.now());
  if (snapshot == nullptr && patience == Patience::left) return std::nullopt;
  if (snapshot == nullptr) snapshot = sources_.board->newest();
  if (snapshot == nullptr) return text_answer(503, "the coordinator has not said anything yet");
  if (auto found = about_service(request, *snapshot)) return found;
  return about_campaign(request, *snapshot, patience);
}

HttpAnswer PageSite::health() const {
  const Duration since_turn = sources_.board->since_turn(sources_.now());
  if (since_turn < turn_interval_max) return text_answer(200, "ok");
  return text_answer(
      503, fmt::format("the service has not come round for {:.0f} s", seconds(since_turn)));
}

std::optional<HttpAnswer> PageSite::about_service(const PageRequest& request,
                                                  const PageSnapshot& snapshot) const {
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
  if (path.size() != 2 || path[0] != "api") return std::nullopt;
  if (path[1] == "status") return json_answer(status_answer(snapshot, now));
  if (path[1] == "workers") return json_answer(workers_answer(snapshot, request, now));
  return std::nullopt;
}

std::optional<HttpAnswer> PageSite::about_campaign(const PageRequest& request,
                                                   const PageSnapshot& snapshot,
                                                   Patience patience) const {
  constexpr std::array<std::string_view, 2> api{"api", "campaigns"};
  const bool is_api = begins_with(request, api);
  const std::size_t name_at = is_api ? 2 : 1;
  if (request.path.size() <= name_at || (!is_api && request.path[0] != "campaigns")) {
    return not_found();
  }
  const std::string& name = request.path[name_at];
  const auto& campaigns = snapshot.service.campaigns;
  const auto found = std::ranges::find(
      campaigns, name,
      [](const CampaignSnapshot& one) -> const std::string& { return one.status.name; });
  const std::size_t num_parts = request.path.size() - name_at;
  if (found == campaigns.end() || num_parts > (is_api ? 2U : 1U)) return not_found();
  const TimePoint now = sources_.now();
  const CampaignDetails details = sources_.details(
      name, {.id = found->id, .file = found->file, .num_finished = found->status.num_done}, now);
  // A page shows what there is, and the rest two seconds later; a program wants all at once.
  if (!is_api) return campaign_html(*found, details, request, now);
  if (details.events == nullptr && patience == Patience::left) return std::nullopt;
  if (num_parts == 1) return json_answer(campaign_answer(*found, details, now));
  if (details.events == nullptr) return text_answer(503, "the database is being read; try again");
  if (request.path[name_at + 1] == "events") {
    return json_answer(events_answer(details, request, name));
  }
  if (request.path[name_at + 1] != "trace") return not_found();
  return json_answer(attempts_trace(details.events->attempts, name));
}

}  // namespace proofmass::coordinator
