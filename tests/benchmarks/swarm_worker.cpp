#include "tests/benchmarks/swarm_worker.hpp"

#include <algorithm>
#include <stdexcept>
#include <string_view>
#include <utility>
#include <variant>

#include "proto/link/socket.hpp"
#include "proto/wire/codec.hpp"

namespace proofmass::test {
namespace {

/// One run in so many is timed: enough, and cheap.
constexpr std::uint64_t timed_run_step = 16;
constexpr std::size_t runs_per_batch = 16;

NullPace pace_of(const SwarmWorkerConfig& config) {
  return {.batch_time_s = config.batch_time_s,
          .num_threads = (config.num_slots + runs_per_batch - 1) / runs_per_batch,
          .elapsed_s = config.elapsed_s};
}

zmq::socket_t connected_dealer(zmq::context_t& context, const SwarmWorkerConfig& config) {
  zmq::socket_t socket = wire::make_dealer(context, config.security);
  socket.connect(config.endpoint);
  return socket;
}

}  // namespace

SwarmWorker::SwarmWorker(zmq::context_t& context, const SwarmWorkerConfig& config,
                         wire::SessionId session, proto::Hello hello, SwarmCount& count,
                         TimePoint now)
    : runs_held_max_(config.runs_held_max),
      count_(count),
      execution_(pace_of(config)),
      socket_(connected_dealer(context, config)),
      conversation_(
          session, std::move(hello), execution_,
          [this](proto::Envelope message) { send(std::move(message)); }, now) {}

int SwarmWorker::descriptor() { return socket_.get(zmq::sockopt::fd); }

void SwarmWorker::serve(TimePoint now) {
  execution_.advance(now);
  note_connection(now);
  zmq::message_t frame;
  while (!has_ended() && socket_.recv(frame, zmq::recv_flags::dontwait)) {
    receive(frame.to_string_view(), now);
    if (execution_.has_finished()) conversation_.on_progress(now);
  }
}

void SwarmWorker::on_tick(TimePoint now) {
  conversation_.on_tick(now);
  serve(now);
}

void SwarmWorker::on_due(TimePoint now) {
  execution_.advance(now);
  if (execution_.has_finished()) conversation_.on_progress(now);
}

/// Reading the events takes in what the descriptor has announced; it announces each thing once. A
/// socket that cannot be written to has lost its connection: no queue of a swarm is ever full.
void SwarmWorker::note_connection(TimePoint now) {
  const bool is_connected = (socket_.get(zmq::sockopt::events) & ZMQ_POLLOUT) != 0;
  if (is_connected == std::exchange(is_connected_, is_connected)) return;
  heartbeats_.clear();  // Nobody will answer those.
  if (is_connected) conversation_.on_connected(now);
}

std::optional<worker::Duration> SwarmWorker::unanswered_for(TimePoint now) const {
  if (heartbeats_.empty()) return std::nullopt;
  return now - heartbeats_.front();
}

void SwarmWorker::send(proto::Envelope message) {
  const TimePoint now = time_now();
  const bool is_heartbeat = message.has_heartbeat();
  if (is_heartbeat) {
    proto::Heartbeat& heartbeat = *message.mutable_heartbeat();
    heartbeat.set_num_runs_max(std::min(heartbeat.num_runs_max(), runs_held_max_));
  }
  if (message.has_result_batch()) note_sent(message.result_batch(), now);
  const std::string bytes = wire::encode(std::move(message));
  if (!socket_.send(zmq::buffer(bytes), zmq::send_flags::dontwait)) {
    ++count_.num_unsent;
  } else if (is_heartbeat) {
    heartbeats_.push_back(now);
  }
}

void SwarmWorker::receive(std::string_view bytes, TimePoint now) {
  const auto decoded = wire::decode(bytes);
  if (const auto* const error = std::get_if<wire::DecodeError>(&decoded)) {
    throw std::runtime_error("the coordinator sent what cannot be read: " + error->text);
  }
  const auto& message = std::get<proto::Envelope>(decoded);
  if (message.has_reject()) heartbeats_.clear();  // The answer to one of them.
  if (message.has_result_ack()) note_acknowledged(message.result_ack(), now);
  if (message.has_heartbeat_ack() && !heartbeats_.empty()) {
    count_.heartbeat_answers_s.push_back(seconds(now - heartbeats_.front()));
    heartbeats_.erase(heartbeats_.begin());
  }
  conversation_.on_message(message, now);
}

void SwarmWorker::note_sent(const proto::ResultBatch& batch, TimePoint now) {
  count_.num_results += static_cast<std::uint64_t>(batch.results_size());
  const wire::CampaignId campaign{batch.campaign()};
  for (const proto::ComputedRun& computed : batch.results()) {
    const RunIndex run{computed.run()};
    if (run.value % timed_run_step == 0) timed_.try_emplace({campaign, run}, now);
  }
}

void SwarmWorker::note_acknowledged(const proto::ResultAck& ack, TimePoint now) {
  for (const std::uint64_t run : ack.runs()) {
    const auto found = timed_.find({{ack.campaign()}, {run}});
    if (found == timed_.end()) continue;
    count_.acknowledgements_s.push_back(seconds(now - found->second));
    timed_.erase(found);
  }
}

}  // namespace proofmass::test
