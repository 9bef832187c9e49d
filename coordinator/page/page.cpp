#include "coordinator/page/page.hpp"

#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <sstream>
#include <string_view>
#include <system_error>
#include <utility>

#include "coordinator/page/campaign_details.hpp"
#include "coordinator/page/http_server.hpp"
#include "coordinator/page/page_access.hpp"
#include "coordinator/page/page_views.hpp"
#include "coordinator/report/status_notes.hpp"
#include "core/error.hpp"
#include "proto/text/visible_text.hpp"
#include "proto/wire/names.hpp"

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
  const TimePoint now = site.now();
  const std::shared_ptr<const ServiceSnapshot> snapshot = site.board->want(now);
  const bool is_new = snapshot != nullptr && now - snapshot->taken_at <= SnapshotBoard::age_max;
  if (!is_new && patience == Patience::left) return std::nullopt;
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

namespace {

class MetricWriter {
 public:
  /// Begins a metric, whose samples follow: a counter if its name ends in `_total`.
  void begin(std::string_view name, std::string_view help) {
    name_ = name;
    text_ += fmt::format("# HELP {0} {1}\n# TYPE {0} {2}\n", name, help,
                         name.ends_with("_total") ? "counter" : "gauge");
  }
  /// @param labels  `{campaign="a"}`, or nothing.
  template <typename Number>
  void add(const std::string& labels, Number value) {
    text_ += fmt::format("{}{} {}\n", name_, labels, value);
  }
  template <typename Number>
  void write(std::string_view name, std::string_view help, Number value) {
    begin(name, help);
    add("", value);
  }
  [[nodiscard]] std::string take() { return std::move(text_); }

 private:
  std::string name_;
  std::string text_;
};

std::string campaign_label(const proto::CampaignStatus& campaign) {
  return fmt::format("{{campaign=\"{}\"}}", label_value(campaign.name()));
}

/// Those with metrics of their own: campaigns that may still change first, then the newest ones.
std::vector<const CampaignRecord*> measured_campaigns(const ServiceSnapshot& service) {
  std::vector<const CampaignRecord*> campaigns;
  const auto add_those = [&](bool is_over) {
    for (auto item = service.campaigns.rbegin(); item != service.campaigns.rend(); ++item) {
      if (campaigns.size() == campaigns_with_metrics_max) return;
      if (has_ended(wire::phase_of(item->status)) == is_over) campaigns.push_back(&*item);
    }
  };
  add_those(false);
  add_those(true);
  return campaigns;
}

using ValueOf = std::function<double(const CampaignRecord&)>;

void write_campaigns(const ServiceSnapshot& service, MetricWriter& writer) {
  const std::vector<const CampaignRecord*> campaigns = measured_campaigns(service);
  const auto write = [&](std::string_view name, std::string_view help, const ValueOf& value) {
    writer.begin(name, help);
    for (const CampaignRecord* campaign : campaigns) {
      writer.add(campaign_label(campaign->status), value(*campaign));
    }
  };
  for (const CampaignCounter& counter : campaign_counters()) {
    write(counter.metric, counter.help, [&](const CampaignRecord& of) {
      return static_cast<double>((of.status.*counter.count)());
    });
  }
  write("proofmass_results_waiting", "Results that are to be stored.",
        [](const auto& of) { return static_cast<double>(of.num_waiting); });
  write("proofmass_storage_failed", "1 while nothing can be stored.",
        [](const auto& of) { return of.status.storage_failure().empty() ? 0.0 : 1.0; });
  write("proofmass_campaign_priority", "Runs of a higher priority are lent first.",
        [](const auto& of) { return static_cast<double>(of.status.priority()); });
  writer.write("proofmass_campaigns_left_out", "Campaigns without metrics of their own.",
               service.campaigns.size() - campaigns.size());
  writer.begin("proofmass_campaigns", "Campaigns by phase.");
  using wire::CampaignPhase;
  for (const CampaignPhase phase : {CampaignPhase::active, CampaignPhase::paused,
                                    CampaignPhase::finished, CampaignPhase::cancelled}) {
    const auto count = std::ranges::count_if(
        service.campaigns, [&](const auto& one) { return wire::phase_of(one.status) == phase; });
    writer.add(fmt::format("{{phase=\"{}\"}}", wire::name_of(phase)), count);
  }
}

void write_service(const ServiceSnapshot& service, MetricWriter& writer) {
  const proto::StatusReply& status = service.status;
  writer.begin("proofmass_info", "1, with the versions as labels.");
  writer.add(fmt::format("{{version=\"{}\",model=\"{}\"}}", label_value(status.version()),
                         label_value(status.model_version())),
             1);
  writer.begin("proofmass_workers", "Registered workers by state.");
  for (std::size_t i = 0; i < worker_activities.size(); ++i) {
    writer.add(fmt::format("{{state=\"{}\"}}", name_of(worker_activities[i])),
               service.num_workers_by_activity[i]);
  }
  writer.write("proofmass_worker_slots", "Runs that all workers compute at a time.",
               status.num_slots());
  writer.write("proofmass_leases", "Leases of runs to workers.", service.num_leases);
  writer.write("proofmass_quarantined_hosts", "Hosts that are lent nothing.",
               status.num_quarantined_hosts());
  writer.write("proofmass_unserved_files", "Files of the directory that cannot be served.",
               status.num_unserved_files());
  writer.write("proofmass_factories", "Factories that report.", status.factories_size());
  writer.write("proofmass_sockets_reset_total",
               "How often a lack of memory or descriptors closed the sockets.",
               service.num_sockets_reset);
  writer.write("proofmass_messages_unsent_total", "Messages to workers that found no room.",
               service.num_messages_unsent);
}

void write_page(const HttpCounts& page, double age_s, MetricWriter& writer) {
  writer.write("proofmass_page_connections", "Open connections of the page.", page.num_connections);
  writer.write("proofmass_page_requests_total", "Requests to the page.", page.num_requests);
  writer.write("proofmass_page_connections_refused_total",
               "Connections to the page that were one too many.", page.num_refused);
  writer.write("proofmass_snapshot_age_seconds", "Age of what these figures say of the service.",
               age_s);
}

/// The fields of /proc/self/stat behind the name of the program, which may hold anything.
std::vector<double> stat_fields() {
  std::ifstream file("/proc/self/stat");
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  const std::size_t end = text.rfind(") ");
  if (end == std::string::npos) return {};
  std::istringstream words(text.substr(end + 4));  // Behind the name and the state.
  return {std::istream_iterator<double>(words), {}};
}

double boot_unix_s() {
  std::ifstream file("/proc/stat");
  std::string line;
  while (std::getline(file, line)) {
    if (line.starts_with("btime ")) return std::stod(line.substr(6));
  }
  return 0.0;
}

std::uint64_t num_open_descriptors() {
  std::error_code error;
  const std::filesystem::directory_iterator directory("/proc/self/fd", error);
  if (error) return 0;
  // Without the directory itself.
  return static_cast<std::uint64_t>(std::distance(begin(directory), end(directory))) - 1;
}

double seconds_of(const timeval& time) {
  return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
}

/// What the kernel says of this process. What cannot be read is 0.
void write_process(MetricWriter& writer) {
  // Places behind the state: proc(5) counts them from 4 on.
  constexpr std::size_t start_ticks = 22 - 4, virtual_size = 23 - 4, resident_pages = 24 - 4;
  rusage usage{};
  rlimit limit{};
  (void)getrusage(RUSAGE_SELF, &usage);
  (void)getrlimit(RLIMIT_NOFILE, &limit);
  std::vector<double> fields = stat_fields();
  const double boot_s = fields.empty() ? 0.0 : boot_unix_s();
  fields.resize(std::max(fields.size(), resident_pages + 1));
  const auto page_size = static_cast<double>(sysconf(_SC_PAGESIZE));
  const auto ticks_per_s = static_cast<double>(sysconf(_SC_CLK_TCK));
  writer.write("process_cpu_seconds_total", "Processor time in seconds.",
               seconds_of(usage.ru_utime) + seconds_of(usage.ru_stime));
  writer.write("process_resident_memory_bytes", "Resident memory in bytes.",
               fields[resident_pages] * page_size);
  writer.write("process_virtual_memory_bytes", "Virtual memory in bytes.", fields[virtual_size]);
  writer.write("process_open_fds", "Open descriptors.", num_open_descriptors());
  writer.write("process_max_fds", "Descriptors that may be open.", limit.rlim_cur);
  writer.write("process_start_time_seconds", "When the process started, in seconds since 1970.",
               boot_s + fields[start_ticks] / ticks_per_s);
}

}  // namespace

std::string label_value(std::string_view text) {
  std::string value;
  while (!text.empty()) {
    const wire::Character character = wire::first_character(text);
    const std::string_view bytes = text.substr(0, character.size);
    if (!character.is_valid) {
      value += "\uFFFD";
    } else if (bytes == "\\" || bytes == "\"") {
      value += fmt::format("\\{}", bytes);
    } else {
      value += bytes == "\n" ? std::string_view("\\n") : bytes;
    }
    text.remove_prefix(character.size);
  }
  return value;
}

std::string metrics_text(const ServiceSnapshot& snapshot, TimePoint now, const HttpCounts& page) {
  MetricWriter writer;
  const double age_s = seconds(now - snapshot.taken_at);
  write_service(snapshot, writer);
  writer.write("proofmass_uptime_seconds", "Since the coordinator started.",
               snapshot.status.uptime_s() + age_s);
  write_campaigns(snapshot, writer);
  write_page(page, age_s, writer);
  write_process(writer);
  return writer.take();
}

}  // namespace proofmass::coordinator
