#include "coordinator/page/page.hpp"

#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "coordinator/page/campaign_details.hpp"
#include "coordinator/page/http_server.hpp"
#include "coordinator/page/page_access.hpp"
#include "coordinator/page/page_views.hpp"
#include "core/error.hpp"

namespace proofmass::coordinator {
namespace {

constexpr std::uint64_t connections_max = 64;
/// The listener, what the library needs, and the databases that are being read.
constexpr std::uint64_t further_descriptors = 16;

TimePoint clock_now() { return std::chrono::steady_clock::now(); }

/// Fewer where the process may have few descriptors.
std::uint64_t connections_allowed() {
  constexpr std::uint64_t share = 16;
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0) return connections_max;
  return std::clamp<std::uint64_t>(limit.rlim_max / share, 1, connections_max);
}

/// Nothing but what the page itself brings is loaded, run or contacted, nobody may put it into a
/// frame, and no answer is kept.
std::vector<std::pair<std::string, std::string>> headers_of_all_answers() {
  return {{"Content-Security-Policy",
           "default-src 'none'; style-src 'self'; img-src 'self' data:; script-src 'self'; "
           "connect-src 'self'; base-uri 'none'; form-action 'self'; frame-ancestors 'none'"},
          {"X-Content-Type-Options", "nosniff"},
          {"Referrer-Policy", "no-referrer"},
          {"Cross-Origin-Resource-Policy", "same-origin"},
          {"Cache-Control", "no-store"}};
}

HttpConfig http_config(const PageAddress& address) {
  HttpConfig http;
  http.host = address.host;
  http.port = address.port;
  http.num_connections_max = connections_allowed();
  http.headers = headers_of_all_answers();
  return http;
}

PageAddress address_of(const PageConfig& config) {
  return parse_page_address(config.address == "true" ? page_address_by_default
                                                     : std::string_view(config.address));
}

PageAccess access_of(const PageConfig& config) {
  if (config.token_file) return PageAccess::read(*config.token_file);
  const PageAddress address = address_of(config);
  if (address.is_loopback) return PageAccess();
  throw InvalidArgument(
      fmt::format("page = {}:{} (must be a loopback address, or with --page-token-file)",
                  address.host, address.port));
}

}  // namespace

void PageConfig::validate() const {
  if (is_wanted()) {
    (void)address_of(*this);
    (void)access_of(*this);
  } else if (token_file) {
    throw InvalidArgument(
        fmt::format("page token file = {} (must be with --page)", token_file->string()));
  }
}

std::uint64_t page_descriptors_max() { return connections_allowed() + further_descriptors; }

Page::Page(const PageConfig& config, const Log& log)
    : address_(address_of(config)),
      board_(clock_now()),
      reader_(read_details),
      site_({.access = access_of(config),
             .board = &board_,
             .details = [this](const CampaignRecord& campaign,
                               TimePoint now) { return reader_.details(campaign, now); },
             .counts = [this] { return server_->counts(); },
             .now = clock_now}) {
  server_ = std::make_unique<HttpServer>(
      http_config(address_), [this](const HttpRequest& request, HttpServer::Patience patience) {
        return site_.answer(request, patience);
      });
  address_.port = server_->port();
  log({.kind = "page_served", .fields = {{"url", url()}}});
  if (address_.is_loopback) return;
  log({.severity = wire::Severity::warning,
       .kind = "page_not_encrypted",
       .fields = {{"url", url()},
                  wire::Field::remark("(whoever can listen on the network sees the page and its "
                                      "token; use a tunnel of ssh or a proxy with TLS)")}});
}

void Page::on_turn(const Service& service) {
  board_.on_turn(clock_now(), [&] { return service.snapshot(); });
}

std::string Page::url() const { return url_of(address_); }

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
            .body = metrics_text(snapshot, now, site.counts())};
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
  std::shared_ptr<const ServiceSnapshot> snapshot = site.board->want(site.now());
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

std::shared_ptr<const ServiceSnapshot> SnapshotBoard::want(TimePoint now) {
  const std::lock_guard lock(mutex_);
  asked_at_ = now;
  return newest_ != nullptr && now - newest_->taken_at <= age_max ? newest_ : nullptr;
}

std::shared_ptr<const ServiceSnapshot> SnapshotBoard::newest() const {
  const std::lock_guard lock(mutex_);
  return newest_;
}

void SnapshotBoard::on_turn(TimePoint now, const std::function<ServiceSnapshot()>& take) {
  std::unique_lock lock(mutex_);
  turned_at_ = now;
  const bool is_wanted = asked_at_ && now - *asked_at_ < wanted_for;
  if (!is_wanted || (newest_ != nullptr && now - newest_->taken_at < interval)) return;
  lock.unlock();
  ServiceSnapshot taken = take();
  taken.taken_at = now;
  auto snapshot = std::make_shared<const ServiceSnapshot>(std::move(taken));
  lock.lock();
  newest_.swap(snapshot);  // What nobody uses any more is freed without the lock.
  lock.unlock();
}

Duration SnapshotBoard::since_turn(TimePoint now) const {
  const std::lock_guard lock(mutex_);
  return now - turned_at_;
}

}  // namespace proofmass::coordinator
