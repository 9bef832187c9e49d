#include "coordinator/net/campaign_service.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <map>
#include <optional>
#include <set>
#include <string_view>
#include <utility>
#include <variant>
#include <zmq.hpp>

#include "coordinator/dispatch/dispatch.hpp"
#include "core/error.hpp"
#include "proto/wire/codec.hpp"
#include "proto/wire/endpoint.hpp"

namespace proofmass::coordinator {
namespace {

constexpr std::chrono::milliseconds turn_duration_max(50);
constexpr int messages_per_turn_max = 1000;  // So that ticks and commits are not put off.
constexpr std::size_t peers_max = 65536;

TimePoint now() { return std::chrono::steady_clock::now(); }

zmq::socket_t bind(zmq::context_t& context, const std::string& endpoint) {
  wire::check_endpoint("bind", endpoint);
  zmq::socket_t socket(context, zmq::socket_type::router);
  socket.set(zmq::sockopt::router_mandatory, true);
  socket.set(zmq::sockopt::linger, 1000);
  socket.set(zmq::sockopt::maxmsgsize, static_cast<std::int64_t>(wire::message_size_max));
  socket.set(zmq::sockopt::handshake_ivl, 5000);
  socket.set(zmq::sockopt::heartbeat_ivl, 5000);
  socket.set(zmq::sockopt::heartbeat_timeout, 20000);
  socket.set(zmq::sockopt::tcp_keepalive, 1);
  try {
    socket.bind(endpoint);
  } catch (const zmq::error_t& error) {
    throw Error(fmt::format("bind = {} ({})", endpoint, error.what()));
  }
  return socket;
}

/// The two names of a peer: the socket's and the dispatch's.
class Peers {
 public:
  /// The worker of a routing id; a new one if it has not been seen.
  WorkerId worker_of(const std::string& routing_id) {
    const auto [entry, is_new] = workers_.try_emplace(routing_id, WorkerId{next_});
    if (is_new) routing_ids_.emplace(WorkerId{next_++}, routing_id);
    return entry->second;
  }

  /// Null if the peer has been forgotten.
  [[nodiscard]] const std::string* routing_id_of(WorkerId worker) const {
    const auto found = routing_ids_.find(worker);
    return found == routing_ids_.end() ? nullptr : &found->second;
  }

  void close_out(WorkerId worker) { closed_out_.insert(worker); }
  [[nodiscard]] bool is_closed_out(WorkerId worker) const { return closed_out_.contains(worker); }

  /// Forgets all peers that are not registered, once there are too many.
  void limit(const State& state) {
    if (routing_ids_.size() < peers_max) return;
    std::erase_if(routing_ids_, [&](const auto& peer) {
      const bool is_stranger = !state.workers.contains(peer.first);
      if (is_stranger) workers_.erase(peer.second);
      return is_stranger;
    });
    closed_out_.clear();
  }

 private:
  std::uint64_t next_ = 1;
  std::map<std::string, WorkerId> workers_;
  std::map<WorkerId, std::string> routing_ids_;
  std::set<WorkerId> closed_out_;
};

}  // namespace

class CampaignService::Parts final : public Outbox {
 public:
  Parts(std::shared_ptr<const Campaign> campaign, std::span<const RunRange> finished,
        const std::string& endpoint, Commit commit, Log log, const ServiceConfig& config)
      : config_(config),
        commit_(std::move(commit)),
        log_(std::move(log)),
        socket_(bind(context_, endpoint)),
        state_(initial_state(std::move(campaign), finished, config.dispatch)),
        started_at_(now()) {}

  [[nodiscard]] std::string endpoint() const { return socket_.get(zmq::sockopt::last_endpoint); }

  bool run(const std::atomic<StopRequest>& stop, const std::function<void()>& on_turn) {
    started_at_ = now();
    while (!is_finished(state_) && stop != StopRequest::now) {
      if (stop == StopRequest::drain && state_.is_lending) on_drain(state_, *this);
      if (!state_.is_lending && is_quiet(state_)) break;
      wait_for_message();
      receive_all();
      on_tick(state_, now(), *this);
      if (is_commit_due()) commit();
      peers_.limit(state_);
      on_turn();
    }
    commit();
    if (!is_finished(state_)) on_stop(state_, *this);
    return is_finished(state_);
  }

  [[nodiscard]] CampaignProgress progress() const {
    const double elapsed_s = std::chrono::duration<double>(now() - started_at_).count();
    const auto num_here = static_cast<double>(state_.num_committed_here);
    return {.num_done = state_.committed.size(),
            .num_runs = state_.campaign->num_runs,
            .num_without_estimate = state_.num_without_estimate,
            .num_workers = state_.workers.size(),
            .rate_hz = elapsed_s > 0.0 ? num_here / elapsed_s : 0.0};
  }

  [[nodiscard]] std::optional<WorkerId> find(std::uint64_t process_id) const {
    for (const auto& [id, worker] : state_.workers) {
      if (worker.process_id == process_id) return id;
    }
    return std::nullopt;
  }

  [[nodiscard]] RunSet runs_held_by(std::uint64_t process_id) const {
    const auto worker = find(process_id);
    return worker ? runs_held(state_, *worker) : RunSet{};
  }

  void process_ended(std::uint64_t process_id, const std::string& reason) {
    // What it sent before it ended may still be waiting in the socket.
    receive_all();
    if (const auto worker = find(process_id)) on_gone(state_, *worker, reason, now(), *this);
  }

  // Outbox.

  /// A message that the peer's queue has no room for, or whose peer is gone, is lost: the dispatch
  /// is made for that.
  void send(WorkerId worker, wire::Message message) override {
    const std::string* const routing_id = peers_.routing_id_of(worker);
    if (routing_id == nullptr) return;
    const std::string bytes = wire::encode(message);
    try {
      const auto flags = zmq::send_flags::dontwait | zmq::send_flags::sndmore;
      if (!socket_.send(zmq::buffer(*routing_id), flags)) return;
      (void)socket_.send(zmq::buffer(bytes), zmq::send_flags::dontwait);
    } catch (const zmq::error_t& error) {
      if (error.num() != EHOSTUNREACH) throw Error(fmt::format("socket: {}", error.what()));
    }
  }

  void store(Arrival arrival) override {
    if (batch_.empty()) batch_began_at_ = now();
    batch_.push_back({.result = arrival.computed.result,
                      .worker = state_.workers.at(arrival.worker).name,
                      .attempt = arrival.attempt.value,
                      .compute_s = arrival.computed.compute_s});
  }

  void log(Event event) override { log_(event); }

 private:
  void wait_for_message() {
    auto timeout = turn_duration_max;
    if (!batch_.empty()) {
      const Duration left = batch_began_at_ + config_.commit_after - now();
      timeout = std::clamp(std::chrono::ceil<std::chrono::milliseconds>(left),
                           std::chrono::milliseconds(0), turn_duration_max);
    }
    std::array<zmq::pollitem_t, 1> items{zmq::pollitem_t{socket_.handle(), 0, ZMQ_POLLIN, 0}};
    try {
      zmq::poll(items.data(), items.size(), timeout);
    } catch (const zmq::error_t& error) {
      if (error.num() != EINTR) throw Error(fmt::format("socket: {}", error.what()));
    }
  }

  void receive_all() {
    for (int i = 0; i < messages_per_turn_max; ++i) {
      zmq::message_t routing_id;
      if (!socket_.recv(routing_id, zmq::recv_flags::dontwait)) return;
      const WorkerId worker = peers_.worker_of(routing_id.to_string());
      std::vector<zmq::message_t> frames;
      while (socket_.get(zmq::sockopt::rcvmore)) {
        // The parts of a message arrive together.
        (void)socket_.recv(frames.emplace_back());
      }
      if (!peers_.is_closed_out(worker)) receive(worker, frames);
    }
  }

  void receive(WorkerId worker, const std::vector<zmq::message_t>& frames) {
    if (frames.size() != 1) {
      return close_out(worker, wire::RejectReason::malformed,
                       fmt::format("message = {} frames (must be one)", frames.size()));
    }
    const auto decoded = wire::decode(frames.front().to_string_view());
    if (const auto* const error = std::get_if<wire::DecodeError>(&decoded)) {
      const bool is_other_version = error->fault == wire::DecodeFault::wrong_version;
      return close_out(
          worker,
          is_other_version ? wire::RejectReason::incompatible : wire::RejectReason::malformed,
          error->text);
    }
    const auto handle_message = [&](const auto& message) { handle(worker, message); };
    std::visit(handle_message, std::get<wire::Message>(decoded));
  }

  void handle(WorkerId id, const wire::Hello& hello) { on_hello(state_, id, hello, now(), *this); }
  void handle(WorkerId id, const wire::Credit& credit) {
    on_credit(state_, id, credit, now(), *this);
  }
  void handle(WorkerId id, const wire::ResultBatch& batch) {
    on_results(state_, id, batch, now(), *this);
  }
  void handle(WorkerId id, const wire::Heartbeat& heartbeat) {
    on_heartbeat(state_, id, heartbeat, now(), *this);
  }
  void handle(WorkerId id, const wire::Bye&) { on_bye(state_, id, now(), *this); }
  template <typename Other>
  void handle(WorkerId id, const Other&) {
    close_out(id, wire::RejectReason::malformed,
              "message = one of a coordinator (must be one of a worker)");
  }

  /// Whoever breaks the protocol is told once and not listened to any more.
  void close_out(WorkerId worker, wire::RejectReason reason, const std::string& text) {
    log({.severity = Severity::warning,
         .kind = "peer_closed_out",
         .text = fmt::format("worker={} {}", worker.value, text)});
    send(worker, wire::Reject{.reason = reason, .text = text});
    on_gone(state_, worker, "protocol", now(), *this);
    peers_.close_out(worker);
  }

  [[nodiscard]] bool is_commit_due() const {
    return batch_.size() >= config_.commit_runs_max ||
           (!batch_.empty() && now() - batch_began_at_ >= config_.commit_after);
  }

  /// Results are acknowledged here and nowhere earlier.
  void commit() {
    if (batch_.empty()) return;
    const std::vector<Delivery> batch = std::exchange(batch_, {});
    commit_(batch);
    std::vector<RunIndex> runs;
    for (const Delivery& delivery : batch) runs.push_back(delivery.result.run);
    on_committed(state_, runs, *this);
  }

  ServiceConfig config_;
  Commit commit_;
  Log log_;
  zmq::context_t context_;
  zmq::socket_t socket_;
  State state_;
  Peers peers_;
  std::vector<Delivery> batch_;
  TimePoint batch_began_at_;
  TimePoint started_at_;
};

CampaignService::CampaignService(std::shared_ptr<const Campaign> campaign,
                                 std::span<const RunRange> finished, const std::string& endpoint,
                                 Commit commit, Log log, const ServiceConfig& config)
    : parts_(std::make_unique<Parts>(std::move(campaign), finished, endpoint, std::move(commit),
                                     std::move(log), config)) {}

CampaignService::~CampaignService() = default;

std::string CampaignService::endpoint() const { return parts_->endpoint(); }

bool CampaignService::run(const std::atomic<StopRequest>& stop,
                          const std::function<void()>& on_turn) {
  return parts_->run(stop, on_turn);
}

CampaignProgress CampaignService::progress() const { return parts_->progress(); }

RunSet CampaignService::runs_held_by(std::uint64_t process_id) const {
  return parts_->runs_held_by(process_id);
}

void CampaignService::process_ended(std::uint64_t process_id, const std::string& reason) {
  parts_->process_ended(process_id, reason);
}

}  // namespace proofmass::coordinator
