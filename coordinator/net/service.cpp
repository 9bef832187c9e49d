#include "coordinator/net/service.hpp"

#include <algorithm>
#include <exception>
#include <functional>
#include <string_view>
#include <thread>
#include <utility>
#include <variant>

#include "coordinator/dispatch/events.hpp"
#include "coordinator/net/background.hpp"
#include "coordinator/net/campaign_files.hpp"
#include "coordinator/net/campaign_service.hpp"
#include "coordinator/net/client_gateway.hpp"
#include "coordinator/net/request_service.hpp"
#include "coordinator/net/server_paths.hpp"
#include "coordinator/net/service_sockets.hpp"
#include "coordinator/net/worker_gateway.hpp"
#include "core/error.hpp"
#include "proto/link/faults.hpp"

namespace proofmass::coordinator {
namespace {

constexpr std::chrono::milliseconds tick_interval(100);
constexpr std::chrono::seconds review_interval(1);
// Who follows a campaign asks every second, and wants to be told how it ended.
constexpr std::chrono::seconds follow_up_max(3);
constexpr std::chrono::seconds dismissal_max(1);
constexpr std::chrono::milliseconds dismissal_interval(10);
// A limit, so that busy workers cannot starve ticks, completions and clients ...
constexpr int worker_messages_per_turn_max = 1000;
// ... nor workers by clients that ask much.
constexpr int client_messages_per_turn_max = 16;

}  // namespace

class Service::Impl final : public Outbox {
 public:
  Impl(const CoordinatorStart& start, std::vector<FileLook> campaigns, const ServiceConfig& config,
       Log log)
      : config_(config),
        log_(std::move(log)),
        start_(start),
        sockets_(config, log_),
        state_(initial_state(config.dispatch, sessions_of(campaigns), now())),
        writer_([this] { sockets_.wake(); }, config.writer),
        worker_gateway_(state_, start_.epoch, worker_callbacks()),
        context_{config_,     start_, state_, writer_,
                 background_, *this,  log_,   [this] { return now(); }},
        campaign_service_(context_),
        request_service_(context_, campaign_service_),
        client_gateway_(background_, client_callbacks()),
        background_([this] { sockets_.wake(); }) {
    limit_workers();
    for (FileLook& look : campaigns) begin_with(std::move(look));
  }

  /// For all that is measured here and in the dispatch.
  [[nodiscard]] TimePoint now() { return time_.at(std::chrono::steady_clock::now()); }
  [[nodiscard]] bool is_done() const {
    return campaign_service_.is_all_done() && campaign_service_.is_all_served();
  }

  void run(const std::atomic<StopRequest>& stop, const std::function<void()>& on_turn) {
    while (!is_over(stop)) {
      sockets_.wait(sockets_.workers().has_faults() ? tick_interval / 10 : tick_interval);
      turn();
      on_turn();
    }
    end(stop == StopRequest::leave);
  }

  [[nodiscard]] ServiceSnapshot snapshot() {
    ServiceSnapshot snapshot{.status = request_service_.service_status(),
                             .campaigns = campaign_service_.records(),
                             .workers = {},
                             .num_leases = state_.leases.size(),
                             .num_sockets_reset = sockets_.num_resets(),
                             .num_messages_unsent = worker_gateway_.num_unsent()};
    take_workers(state_, now(), snapshot);
    paths_.hide_in(snapshot.status);
    for (CampaignRecord& campaign : snapshot.campaigns) paths_.hide_in(campaign.status);
    return snapshot;
  }

  void worker_ended(WorkerId worker, LossReason reason) {
    // What it sent before it ended may still be waiting in the socket.
    receive_from_workers();
    on_gone(state_, worker, reason, now(), *this);
  }

  // Outbox.

  void send(WorkerId worker, proto::Envelope message) override {
    worker_gateway_.send(worker, std::move(message));
  }

  void send_definition(WorkerId worker, CampaignId campaign, std::uint64_t offset,
                       const std::shared_ptr<const Campaign>& definition) override {
    worker_gateway_.send_definition(worker, campaign, offset, definition);
  }

  void write(CampaignId campaign, Entry entry) override {
    const bool is_delivery = std::holds_alternative<Delivery>(entry);
    writer_.write(campaign, std::move(entry));
    if (is_delivery && expects_no_result(state_.campaigns.at(campaign))) writer_.hurry(campaign);
  }
  using Outbox::log;
  void log(Event event, CampaignId campaign) override {
    if (campaign == CampaignId{} || campaign_service_.is_served(campaign)) {
      writer_.write(campaign, entry_of(event));
    }
    const auto served = state_.campaigns.find(campaign);
    if (served != state_.campaigns.end()) {
      event.fields.emplace_back("campaign", served->second.definition->name);
    }
    log_(event);
  }

 private:
  friend class Service;

  /// Registers no more workers than there are descriptors for; `proofmass run` has few of them.
  void limit_workers() {
    const Descriptors& descriptors = sockets_.descriptors();
    std::size_t& num_workers_max = state_.config.num_workers_max;
    if (!config_.clients_endpoint || descriptors.num_workers_max >= num_workers_max) return;
    num_workers_max = descriptors.num_workers_max;
    log(Event::warning(
        "few_descriptors",
        {{"limit", descriptors.limit},
         {"workers_max", num_workers_max},
         Field::remark("(raise the limit of open files, ulimit -n or LimitNOFILE, to "
                       "serve more)")}));
  }

  /// Campaigns that are handed over are served or end the start; those of the directory may wait.
  void begin_with(FileLook look) {
    if (config_.directory != nullptr) return campaign_service_.take(std::move(look));
    campaign_service_.add(std::move(look));
  }

  WorkerGateway::Callbacks worker_callbacks() {
    return {.transmit =
                [this](const std::string& routing_id, const std::string& bytes) {
                  return sockets_.workers().send(routing_id, bytes, now());
                },
            .is_allowed =
                [this](const std::string& key, TimePoint time) {
                  Authenticator* const authenticator = sockets_.authenticator();
                  return authenticator == nullptr ||
                         authenticator->is_allowed(wire::KeyRole::worker, key, time);
                }};
  }

  ClientGateway::Callbacks client_callbacks() {
    return {.transmit =
                [this](const std::string& routing_id, const std::string& bytes) {
                  (void)sockets_.clients()->send(routing_id, bytes, now());
                  if (!campaign_service_.is_all_done()) told_progress_at_ = now();
                },
            .asker_of = [this](const std::string& key) -> std::optional<Asker> {
              Authenticator* const authenticator = sockets_.authenticator();
              return authenticator == nullptr ? Asker{} : authenticator->client(key, now());
            },
            .carry_out =
                [this](Request request, const Asker& asker, Respond respond) {
                  request_service_.carry_out(std::move(request), asker, std::move(respond));
                },
            .now = [this] { return now(); },
            .paths = paths_};
  }

  /// Carries out what is asked for; true if nothing remains to be done.
  bool is_over(const std::atomic<StopRequest>& stop) {
    if (stop == StopRequest::now || stop == StopRequest::leave) return true;
    if (stop == StopRequest::drain && !drained_until_) {
      log(Event::info("coordinator_draining"));
      drained_until_ = now() + config_.drain_max;
      on_drain(state_, *this);
    }
    if (drained_until_) {
      return is_quiet(state_, campaign_service_.abandoned()) || now() > *drained_until_;
    }
    return config_.end == ServiceEnd::when_done && is_done() && background_.is_idle() &&
           campaign_service_.is_all_told() && !is_followed();
  }

  /// True if a client that was told of a campaign's progress may not know yet that it is over.
  [[nodiscard]] bool is_followed() {
    return told_progress_at_ && now() - *told_progress_at_ < follow_up_max;
  }

  void turn() {
    sockets_.serve(now());
    receive_from_workers();
    take_completions();
    receive_from_clients();
    finish_background();
    if (now() - ticked_at_ < tick_interval) return;
    ticked_at_ = now();
    on_tick(state_, ticked_at_, *this);
    campaign_service_.review();
    campaign_service_.review_directory();
    request_service_.review();
    client_gateway_.review();
    if (ticked_at_ - reviewed_at_ < review_interval) return;
    reviewed_at_ = ticked_at_;
    review();
  }

  void review() {
    worker_gateway_.review(reviewed_at_, *this);
    const std::uint64_t num_unsent = worker_gateway_.num_unsent();
    if (num_unsent == num_unsent_logged_) return;
    log(Event::warning("messages_unsent", {{"count", num_unsent - num_unsent_logged_}}));
    num_unsent_logged_ = num_unsent;
  }

  void receive_from_workers() {
    const int count = sockets_.workers().receive(
        worker_messages_per_turn_max, now(), [this](const Incoming& message) {
          guarded("worker", [&] { worker_gateway_.receive(message, now(), *this); });
        });
    state_.is_behind = count == worker_messages_per_turn_max;
  }

  void receive_from_clients() {
    if (sockets_.clients() == nullptr) return;
    (void)sockets_.clients()->receive(
        client_messages_per_turn_max, now(), [this](const Incoming& message) {
          guarded("client", [&] { client_gateway_.receive(message); });
        });
  }

  void finish_background() {
    for (const Background::Finish& finish : background_.take_finished()) {
      guarded("background", finish);
    }
  }

  /// Work that is done may have a next step, such as the closing of a file.
  void settle_background() {
    while (!background_.is_idle()) {
      background_.wait();
      finish_background();
    }
  }

  /// Nothing that one peer or file does may end the service of all.
  void guarded(std::string_view who, const std::function<void()>& action) {
    try {
      action();
    } catch (const std::exception& error) {
      log(Event::error("request_failed", {{"of", who}, Field::reason(error.what())}));
    }
  }

  void take_completions() {
    for (const Completion& completion : writer_.take_completions()) {
      std::visit([this](const auto& content) { complete(content); }, completion);
    }
  }

  void complete(const Committed& committed) {
    wire::kill_point(wire::KillPoint::after_commit);
    on_committed(state_, committed.campaign, committed.runs, now(), *this);
  }
  void complete(const Compared& compared) {
    const auto& [run, session, is_equal] = compared.comparison;
    const auto worker = worker_gateway_.peers().worker_of(session);
    on_compared(state_, compared.campaign, run, worker.value_or(WorkerId{}), is_equal, now(),
                *this);
  }
  void complete(const StoreFailed& failed) {
    if (!campaign_service_.is_served(failed.campaign)) return;
    on_store_failed(state_, failed.campaign, failed.text, *this);
    if (failed.is_abandoned) campaign_service_.abandon(failed.campaign);
  }
  void complete(const StoreRecovered& recovered) {
    if (!campaign_service_.is_served(recovered.campaign)) return;
    on_store_recovered(state_, recovered.campaign, now(), *this);
  }

  void complete(const FileEvent& happened) { log(happened.event, happened.campaign); }

  /// Results are acknowledged before their workers are told to end.
  void end(bool leaves_workers) {
    settle_background();
    writer_.flush();
    take_completions();
    for (const auto& [id, campaign] : state_.campaigns) note_unstored(id, campaign);
    campaign_service_.review();  // Statistics are made while the workers end.
    if (!leaves_workers) dismiss_workers();
    settle_background();
    if (!leaves_workers) on_end(state_, *this);
  }

  /// Until all have gone: what is sent just before a socket is closed is sometimes lost, and a
  /// worker without a coordinator would wait for another one.
  void dismiss_workers() {
    const auto deadline = now() + dismissal_max;
    std::uint64_t num_unsent = 0;
    do {
      num_unsent = worker_gateway_.num_unsent();
      on_stop(state_, *this);
      num_unsent = worker_gateway_.num_unsent() - num_unsent;
      if (num_unsent < state_.workers.size()) std::this_thread::sleep_for(dismissal_interval);
    } while (num_unsent < state_.workers.size() && now() < deadline);
  }

  void note_unstored(CampaignId id, const CampaignState& campaign) {
    if (campaign.storage_failure.empty() && campaign.delivered.empty()) return;
    has_storage_failed_ = true;
    log(Event::error("results_not_stored", {{"runs", campaign.delivered.size()},
                                            Field::reason(campaign.storage_failure)}),
        id);
  }

  WakingTime time_{std::chrono::steady_clock::now()};
  ServiceConfig config_;
  ServerPaths paths_{config_.answer_directory.parent_path()};
  Log log_;
  CoordinatorStart start_;
  ServiceSockets sockets_;
  State state_;
  StoreWriter writer_;
  WorkerGateway worker_gateway_;
  ServiceContext context_;
  CampaignService campaign_service_;
  RequestService request_service_;
  ClientGateway client_gateway_;
  std::optional<TimePoint> drained_until_;
  std::optional<TimePoint> told_progress_at_;  ///< To any client.
  TimePoint ticked_at_;
  TimePoint reviewed_at_;
  std::uint64_t num_unsent_logged_ = 0;
  bool has_storage_failed_ = false;
  Background background_;  ///< Ends before all that its work uses.
};

Service::Service(std::vector<ServedCampaign> campaigns, const ServiceConfig& config, Log log) {
  const CoordinatorStart start = coordinator_start(config.version);
  std::vector<FileLook> looks =
      looks_at_beginning(std::move(campaigns), config.given_up, config.directory, start,
                         config.num_descriptors_reserved);
  impl_ = std::make_unique<Impl>(start, std::move(looks), config, std::move(log));
}

Service::~Service() = default;

std::string Service::workers_endpoint() const { return impl_->sockets_.workers().endpoint(); }

std::string Service::clients_endpoint() const {
  RouterSocket* const clients = impl_->sockets_.clients();
  return clients == nullptr ? std::string() : clients->endpoint();
}

void Service::run(const std::atomic<StopRequest>& stop, const std::function<void()>& on_turn) {
  impl_->run(stop, on_turn);
}

std::vector<proto::CampaignStatus> Service::campaigns() const {
  std::vector<proto::CampaignStatus> statuses;
  for (CampaignRecord& campaign : impl_->campaign_service_.records()) {
    statuses.push_back(std::move(campaign.status));
  }
  return statuses;
}

ServiceSnapshot Service::snapshot() const { return impl_->snapshot(); }

bool Service::is_done() const { return impl_->is_done(); }

bool Service::has_storage_failed() const { return impl_->has_storage_failed_; }

std::optional<WorkerId> Service::worker_of(std::uint64_t process_id) const {
  for (const auto& [id, worker] : impl_->state_.workers) {
    if (worker.process_id == process_id) return id;
  }
  return std::nullopt;
}

const State& Service::state() const { return impl_->state_; }

void Service::worker_ended(WorkerId worker, LossReason reason) {
  impl_->worker_ended(worker, reason);
}

std::vector<ServedCampaign> Service::close() { return impl_->campaign_service_.close(); }

}  // namespace proofmass::coordinator
