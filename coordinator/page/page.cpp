#include "coordinator/page/page.hpp"

#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <chrono>

#include "coordinator/page/campaign_details.hpp"
#include "coordinator/page/http_server.hpp"
#include "coordinator/page/page_site.hpp"
#include "coordinator/page/snapshot_board.hpp"
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

HttpConfig http_config(const PageConfig& config) {
  HttpConfig http;
  http.host = config.address.host;
  http.port = config.address.port;
  http.num_connections_max = connections_allowed();
  http.headers = headers_of_all_answers();
  return http;
}

std::optional<PageToken> token_of(const PageConfig& config) {
  if (config.token_file) return PageToken::read(*config.token_file);
  if (config.address.is_loopback) return std::nullopt;
  throw InvalidArgument(
      fmt::format("page = {}:{} (must be a loopback address, or with --page-token-file)",
                  config.address.host, config.address.port));
}

}  // namespace

void PageConfig::validate() const { (void)token_of(*this); }

std::uint64_t page_descriptors_max() { return connections_allowed() + further_descriptors; }

struct Page::Impl {
  explicit Impl(const PageConfig& page_config)
      : address(page_config.address),
        board(clock_now()),
        reader(read_details),
        site({.access = PageAccess(token_of(page_config)),
              .board = &board,
              .details = [this](const CampaignRecord& campaign,
                                TimePoint now) { return reader.details(campaign, now); },
              .counts = [this] { return server->counts(); },
              .now = clock_now}) {
    server = std::make_unique<HttpServer>(
        http_config(page_config),
        [this](const HttpRequest& request, HttpServer::Patience patience) {
          return site.answer(request, patience);
        });
    address.port = server->port();
  }

  PageAddress address;
  SnapshotBoard board;
  DetailReader reader;
  PageSite site;
  std::unique_ptr<HttpServer> server;  ///< Ends before what it uses.
};

Page::Page(const PageConfig& config, const Log& log) : impl_(std::make_unique<Impl>(config)) {
  log({.kind = "page_served", .fields = {{"url", url()}}});
  if (config.address.is_loopback) return;
  log({.severity = wire::Severity::warning,
       .kind = "page_not_encrypted",
       .fields = {{"url", url()},
                  wire::Field::remark("(whoever can listen on the network sees the page and its "
                                      "token; use a tunnel of ssh or a proxy with TLS)")}});
}

Page::~Page() = default;

void Page::on_turn(const Service& service) {
  impl_->board.on_turn(clock_now(), [&](SnapshotDepth depth) { return service.snapshot(depth); });
}

std::string Page::url() const { return url_of(impl_->address); }

}  // namespace proofmass::coordinator
