#include "coordinator/net/service.hpp"

#include <fmt/format.h>
#include <sys/random.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <map>
#include <set>
#include <utility>
#include <variant>

#include "coordinator/dispatch/dispatch.hpp"
#include "coordinator/net/campaign_desk.hpp"
#include "coordinator/net/client_desk.hpp"
#include "coordinator/net/descriptor_limit.hpp"
#include "coordinator/net/service_sockets.hpp"
#include "coordinator/net/waking_time.hpp"
#include "coordinator/net/worker_desk.hpp"
#include "coordinator/net/worker_history.hpp"
#include "core/error.hpp"
#include "proto/link/kill_point.hpp"
#include "proto/wire/names.hpp"

namespace proofmass::coordinator {
namespace {

constexpr std::chrono::milliseconds tick_interval(100);
constexpr std::chrono::seconds review_interval(1);
// Who follows a campaign asks every second, and wants to be told how it ended.
constexpr std::chrono::seconds follow_up_max(3);
// So that ticks, completions and clients are not put off by workers that talk much ...
constexpr int worker_messages_per_turn_max = 1000;
// ... nor workers by clients that ask much.
constexpr int client_messages_per_turn_max = 16;

wire::Epoch random_epoch() {
  wire::Epoch epoch;
  while (epoch.value == 0) {
    if (getrandom(&epoch.value, sizeof epoch.value, 0) < 0 && errno != EINTR) {
      throw Error(fmt::format("getrandom: {}", std::strerror(errno)));
    }
  }
  return epoch;
}

CoordinatorStart coordinator_start(wire::Epoch epoch, const std::string& version) {
  std::array<char, 256> host{};
  gethostname(host.data(), host.size() - 1);
  return {.epoch = epoch,
          .host = wire::name_from(host.data()),
          .process_id = static_cast<std::uint64_t>(getpid()),
          .version = version};
}

/// What is logged of a campaign file that lost its name and has it back.
std::string_view kind_of(FileReturn file_return) {
  switch (file_return) {
    case FileReturn::restored:
      return "campaign_file_restored";
    case FileReturn::replaced:
      return "campaign_file_replaced";
    case FileReturn::log_made_anew:
      return "write_ahead_log_restored";
  }
  return "campaign_file_restored";
}

std::set<SessionId> attached_sessions(const std::vector<ServedCampaign>& campaigns) {
  std::set<SessionId> attached;
  for (const ServedCampaign& campaign : campaigns) {
    const std::vector<SessionId> sessions = campaign.store.attached_sessions();
    attached.insert(sessions.begin(), sessions.end());
  }
  return attached;
}

}  // namespace

class Service::Parts final : public Outbox {
 public:
  Parts(std::vector<ServedCampaign> campaigns, const ServiceConfig& config, Log log)
      : Parts(attached_sessions(campaigns), config, std::move(log)) {
    for (ServedCampaign& campaign : campaigns) {
      desk_.serve(std::move(campaign), config_.given_up, now(), *this);
    }
  }

  /// For all that is measured here and in the dispatch.
  [[nodiscard]] TimePoint now() { return time_.at(std::chrono::steady_clock::now()); }
  [[nodiscard]] const State& state() const { return state_; }
  [[nodiscard]] const CampaignDesk& desk() const { return desk_; }
  [[nodiscard]] const ServiceSockets& sockets() const { return sockets_; }

  void run(const std::atomic<StopRequest>& stop, const std::function<void()>& on_turn) {
    while (!is_over(stop)) {
      sockets_.wait(config_.faults ? tick_interval / 10 : tick_interval);
      turn();
      on_turn();
    }
    end();
  }

  void worker_ended(WorkerId worker, LossReason reason) {
    // What it sent before it ended may still be waiting in the socket.
    receive_from_workers();
    history_.note_reason(worker, reason);
    on_gone(state_, worker, reason, now(), *this);
  }

  std::vector<ServedCampaign> close() { return desk_.close(); }

  // Outbox.

  void send(WorkerId worker, wire::Message message) override {
    if (std::holds_alternative<wire::Welcome>(message)) history_.note_registered(worker);
    const auto* lease = std::get_if<wire::RunLease>(&message);
    if (lease != nullptr) history_.note_lent(lease->campaign, worker);
    worker_desk_.send(worker, std::move(message));
  }

  void send_definition(WorkerId worker, const wire::CampaignRequest& request,
                       const std::shared_ptr<const Campaign>& definition) override {
    worker_desk_.send_definition(worker, request, definition);
  }

  void store(Arrival arrival) override {
    const CampaignId campaign = arrival.campaign;
    writer_.deliver(campaign, delivery_of(std::move(arrival)));
  }

  void compare(Arrival arrival) override {
    const CampaignId campaign = arrival.campaign;
    writer_.compare(campaign, delivery_of(std::move(arrival)));
  }

  void record(const Loss& loss) override {
    const auto session = worker_desk_.peers().session_of(loss.worker);
    history_.note_lent(loss.campaign, loss.worker);
    history_.note_reason(loss.worker, loss.reason);
    writer_.record_loss(loss.campaign, {.runs = loss.runs,
                                        .attempt = loss.attempt,
                                        .worker = session.value_or(SessionId{}),
                                        .reason = loss.reason,
                                        .is_blamed = loss.is_blamed});
  }

  void give_up(CampaignId campaign, RunIndex run) override { writer_.give_up(campaign, run); }

  void log(Event event) override {
    log_(event);
    writer_.record_event(event.campaign, {.kind = std::string(event.kind), .text = event.text});
  }

 private:
  Parts(std::set<SessionId> attached, const ServiceConfig& config, Log log)
      : config_(config),
        log_(std::move(log)),
        epoch_(random_epoch()),
        sockets_(config, log_),
        state_(initial_state(config.dispatch, attached, now())),
        writer_([this] { sockets_.wake(); }, config.writer),
        history_(state_, writer_, std::move(attached)),
        worker_desk_(state_, epoch_, surroundings()),
        desk_(state_, writer_, config.files, coordinator_start(epoch_, config.version), now()) {
    raise_descriptor_limit();
  }

  WorkerDesk::Surroundings surroundings() {
    return {.transmit =
                [this](const std::string& routing_id, const std::string& bytes) {
                  return sockets_.send_to_worker(routing_id, bytes, now());
                },
            .is_allowed =
                [this](const std::string& key, TimePoint time) {
                  return is_allowed(wire::Domain::workers, key, time);
                },
            .on_leaving = [this](WorkerId worker,
                                 LossReason reason) { history_.note_reason(worker, reason); }};
  }

  [[nodiscard]] bool is_allowed(wire::Domain domain, const std::string& key, TimePoint time) {
    Authenticator* const authenticator = sockets_.authenticator();
    return authenticator == nullptr || authenticator->is_allowed(domain, key, time);
  }

  Delivery delivery_of(Arrival arrival) {
    history_.note_lent(arrival.campaign, arrival.worker);
    const auto session = worker_desk_.peers().session_of(arrival.worker);
    PROOFMASS_EXPECT(session.has_value());
    return {.result = arrival.computed.result,
            .worker = *session,
            .attempt = arrival.attempt,
            .compute_s = arrival.computed.compute_s};
  }

  /// Carries out what is asked for; true if nothing remains to be done.
  bool is_over(const std::atomic<StopRequest>& stop) {
    if (stop == StopRequest::now) return true;
    if (stop == StopRequest::drain && !drained_until_) {
      log({.kind = "coordinator_draining", .text = {}});
      drained_until_ = now() + config_.drain_max;
      on_drain(state_, *this);
    }
    if (drained_until_) return is_quiet(state_) || now() > *drained_until_;
    return config_.end == ServiceEnd::when_done && desk_.is_all_done() && !is_followed();
  }

  /// True if a client that was told of a campaign's progress may not know yet that it is over.
  [[nodiscard]] bool is_followed() {
    return told_progress_at_ && now() - *told_progress_at_ < follow_up_max;
  }

  void turn() {
    sockets_.serve(now());
    receive_from_workers();
    for (const Completion& completion : writer_.take_completions()) {
      std::visit([this](const auto& content) { complete(content); }, completion);
    }
    receive_from_clients();
    if (now() - ticked_at_ < tick_interval) return;
    ticked_at_ = now();
    on_tick(state_, ticked_at_, *this);
    desk_.review(ticked_at_, *this);
    history_.review();
    if (ticked_at_ - reviewed_at_ < review_interval) return;
    reviewed_at_ = ticked_at_;
    review();
  }

  void review() {
    worker_desk_.review(reviewed_at_, *this);
    const std::uint64_t num_unsent = worker_desk_.num_unsent();
    if (num_unsent == num_unsent_logged_) return;
    log({.severity = Severity::warning,
         .kind = "messages_unsent",
         .text = fmt::format("count={}", num_unsent - num_unsent_logged_)});
    num_unsent_logged_ = num_unsent;
  }

  void receive_from_workers() {
    sockets_.receive_from_workers(
        worker_messages_per_turn_max, now(),
        [this](const Incoming& message) { worker_desk_.receive(message, now(), *this); });
  }

  void receive_from_clients() {
    const auto handle = [this](const Incoming& message) {
      const std::string reply = answer_client(
          message.frames,
          [&](const wire::ClientRequest& request) { return answer(request, message.from); });
      (void)sockets_.send_to_client(message.from.routing_id, reply, now());
    };
    sockets_.receive_from_clients(client_messages_per_turn_max, now(), handle);
  }

  wire::ClientReply answer(const wire::ClientRequest& request, const Address& from) {
    if (!is_allowed(wire::Domain::clients, from.key, now())) {
      return wire::ErrorReply{.text =
                                  fmt::format("key = {} (is not authorized any more)", from.key)};
    }
    wire::ClientReply reply = desk_.answer(request, now(), *this);
    if (!desk_.is_all_done()) told_progress_at_ = now();
    return reply;
  }

  void complete(const Committed& committed) {
    wire::kill_point(wire::KillPoint::after_commit);
    on_committed(state_, committed.campaign, committed.runs, now(), *this);
  }
  void complete(const Compared& compared) {
    const auto& [run, session, is_equal] = compared.comparison;
    const auto worker = worker_desk_.peers().worker_of(session);
    on_compared(state_, compared.campaign, run, worker.value_or(WorkerId{}), is_equal, now(),
                *this);
  }
  void complete(const StoreFailed& failed) {
    on_store_failed(state_, failed.campaign, failed.text, *this);
  }
  void complete(const StoreRecovered& recovered) {
    on_store_recovered(state_, recovered.campaign, now(), *this);
  }

  void complete(const LogGrown& grown) {
    log({.severity = Severity::warning,
         .kind = "write_ahead_log_grown",
         .text = fmt::format("size_bytes={} (somebody reads an old state of the file)", grown.size),
         .campaign = grown.campaign});
  }
  void complete(const FileReturned& returned) {
    log({.severity = Severity::warning,
         .kind = kind_of(returned.kind),
         .text = fmt::format("runs={}", state_.campaigns.at(returned.campaign).committed.size()),
         .campaign = returned.campaign});
  }
  void complete(const LogKept& kept) {
    log({.severity = Severity::warning,
         .kind = "write_ahead_log_kept",
         .text = fmt::format("reason=\"{}\"", kept.reason),
         .campaign = kept.campaign});
  }
  void complete(const LogFolded& folded) {
    log({.severity = Severity::info,
         .kind = "write_ahead_log_folded",
         .text = "",
         .campaign = folded.campaign});
  }
  void complete(const LogShrunk& shrunk) {
    log({.severity = Severity::info,
         .kind = "write_ahead_log_shrunk",
         .text = "",
         .campaign = shrunk.campaign});
  }

  /// Results are acknowledged before their workers are told to end.
  void end() {
    writer_.flush();
    for (const Completion& completion : writer_.take_completions()) {
      std::visit([this](const auto& content) { complete(content); }, completion);
    }
    on_stop(state_, *this);
    desk_.review(now(), *this);
    history_.end_all(LossReason::drained);
  }

  WakingTime time_{std::chrono::steady_clock::now()};
  ServiceConfig config_;
  Log log_;
  wire::Epoch epoch_;
  ServiceSockets sockets_;
  State state_;
  StoreWriter writer_;
  WorkerHistory history_;
  WorkerDesk worker_desk_;
  CampaignDesk desk_;
  std::optional<TimePoint> drained_until_;
  std::optional<TimePoint> told_progress_at_;  ///< To any client.
  TimePoint ticked_at_;
  TimePoint reviewed_at_;
  std::uint64_t num_unsent_logged_ = 0;
};

Service::Service(std::vector<ServedCampaign> campaigns, const ServiceConfig& config, Log log)
    : parts_(std::make_unique<Parts>(std::move(campaigns), config, std::move(log))) {}

Service::~Service() = default;

std::string Service::workers_endpoint() const { return parts_->sockets().workers_endpoint(); }

std::string Service::clients_endpoint() const { return parts_->sockets().clients_endpoint(); }

void Service::run(const std::atomic<StopRequest>& stop, const std::function<void()>& on_turn) {
  parts_->run(stop, on_turn);
}

std::vector<wire::CampaignStatus> Service::campaigns() const {
  std::vector<wire::CampaignStatus> campaigns;
  for (const CampaignId id : parts_->state().order) {
    campaigns.push_back(parts_->desk().status_of(id, parts_->now()));
  }
  return campaigns;
}

bool Service::is_done() const { return parts_->desk().is_all_done(); }

std::optional<WorkerId> Service::worker_of(std::uint64_t process_id) const {
  for (const auto& [id, worker] : parts_->state().workers) {
    if (worker.process_id == process_id) return id;
  }
  return std::nullopt;
}

std::string Service::runs_held_text(WorkerId worker) const {
  return coordinator::runs_held_text(parts_->state(), worker);
}

bool Service::is_quarantined(const std::string& host) const {
  return coordinator::is_quarantined(parts_->state(), host);
}

void Service::worker_ended(WorkerId worker, LossReason reason) {
  parts_->worker_ended(worker, reason);
}

std::vector<ServedCampaign> Service::close() { return parts_->close(); }

}  // namespace proofmass::coordinator
