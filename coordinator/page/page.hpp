#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "coordinator/dispatch/outbox.hpp"
#include "coordinator/net/service.hpp"
#include "coordinator/net/service_snapshot.hpp"
#include "coordinator/page/campaign_details.hpp"
#include "coordinator/page/http_server.hpp"
#include "coordinator/page/page_access.hpp"

namespace proofmass::coordinator {

/// Where the thread of a service leaves snapshots for the thread of a page. The service makes one a
/// second at most, and none if nobody has asked for 30 s, so that a page at which nobody looks
/// costs nothing. Any thread may call the functions. Times are of the steady clock.
class SnapshotBoard {
 public:
  static constexpr std::chrono::milliseconds interval{1000};
  static constexpr std::chrono::milliseconds wanted_for{30'000};
  static constexpr std::chrono::milliseconds age_max{1500};

  explicit SnapshotBoard(TimePoint now) : turned_at_(now) {}

  /// Asks for snapshots: of one older than `age_max`, a new one comes with the next turn of the
  /// service.
  /// @return The newest one, however old it is; null before the first.
  [[nodiscard]] std::shared_ptr<const ServiceSnapshot> want(TimePoint now);

  /// To be called in each turn of the service's loop.
  /// @param take  Makes a snapshot; called if one is wanted.
  void on_turn(TimePoint now, const std::function<ServiceSnapshot()>& take);

  /// Since the last turn, or since the board was made.
  [[nodiscard]] Duration since_turn(TimePoint now) const;

 private:
  mutable std::mutex mutex_;
  TimePoint turned_at_;
  std::optional<TimePoint> asked_at_;
  /// Shared with answers that are being made of it.
  std::shared_ptr<const ServiceSnapshot> newest_;
};

/// Which address has which answer; README.md lists them. All members but the access may be used
/// from the thread of the page only.
struct PageSite {
  PageAccess access = {};
  SnapshotBoard* board = nullptr;  ///< Outlives the site; not null.
  /// As DetailReader::details().
  std::function<std::shared_ptr<const CampaignDetails>(const CampaignRecord&, TimePoint)> details;
  std::function<HttpCounts()> counts;  ///< Of the server.
  std::function<TimePoint()> now;      ///< Steady clock.

  /// As HttpServer::Handler.
  [[nodiscard]] std::optional<HttpAnswer> answer(const HttpRequest& request,
                                                 HttpServer::Patience patience) const;
};

/// Campaigns that have metrics of their own, so that the number of series is bounded; how many are
/// left out is one of the metrics.
inline constexpr std::size_t campaigns_with_metrics_max = 200;

/// All metrics in Prometheus' text format 0.0.4, those of this process at this moment among them.
/// README.md names those that deserve an alert.
[[nodiscard]] std::string metrics_text(const ServiceSnapshot& snapshot, TimePoint now,
                                       const HttpCounts& page);

/// A label's value with backslash, quote and end of line escaped, and what is not UTF-8 visible.
[[nodiscard]] std::string label_value(std::string_view text);

struct PageConfig {
  /// Of parse_page_address(); `true`: page_address_by_default; empty or `false`: there is no page.
  /// These are the words of the command line for a flag.
  std::string address = {};
  /// Secret that visitors must show; needed for addresses that other machines reach.
  std::optional<std::filesystem::path> token_file = {};

  [[nodiscard]] bool is_wanted() const { return !address.empty() && address != "false"; }
  /// @throws InvalidArgument `page = HOST:PORT (rule)` if the address is none, or needs a token;
  ///         `page token file = PATH (rule)` without a page; Error if that file cannot be used.
  void validate() const;
};

/// Descriptors that a live page may take beside those of the service.
[[nodiscard]] std::uint64_t page_descriptors_max();

/// The live page of a service: an HTTP server in a thread of its own and a thread that reads
/// campaign databases, for whose end the destructor waits. Neither touches the service: on_turn()
/// hands them snapshots.
class Page {
 public:
  /// Listens. Warns if other machines can reach the address, because nothing is encrypted.
  /// @pre The page is wanted.
  /// @throws Error as PageConfig::validate() does, or if the address cannot be used.
  Page(const PageConfig& config, const Log& log);
  Page(const Page&) = delete;
  Page& operator=(const Page&) = delete;

  /// To be called in each turn of the service's loop, in its thread.
  void on_turn(const Service& service);

  [[nodiscard]] std::string url() const;  ///< `http://127.0.0.1:5557/`

 private:
  PageAddress address_;
  SnapshotBoard board_;
  DetailReader reader_;
  PageSite site_;
  std::unique_ptr<HttpServer> server_;  ///< Ends before what it uses.
};

}  // namespace proofmass::coordinator
