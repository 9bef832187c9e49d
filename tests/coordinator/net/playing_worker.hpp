#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>
#include <zmq.hpp>

#include "core/campaign/run_result.hpp"
#include "core/error.hpp"
#include "core/microscope/campaign/microscope_campaign.hpp"
#include "core/microscope/simulation/run.hpp"
#include "proto/link/socket.hpp"
#include "proto/wire/codec.hpp"
#include "tests/support/drawn_result.hpp"

namespace proofmass::test {

/// A worker that the test plays itself, over a real socket. Every receive has a deadline, so that a
/// failing test ends.
class PlayingWorker {
 public:
  explicit PlayingWorker(const std::string& endpoint, std::uint64_t session = 1001,
                         const wire::ClientSecurity& security = {})
      : endpoint_(endpoint), session_{session}, security_(security), socket_(connected_socket()) {}

  /// Another connection, as after a cut cable.
  void reconnect() { socket_ = connected_socket(); }

  void send_frames(const std::vector<std::string>& frames) {
    for (std::size_t i = 0; i < frames.size(); ++i) {
      const bool is_last = i + 1 == frames.size();
      (void)socket_.send(zmq::buffer(frames[i]),
                         is_last ? zmq::send_flags::none : zmq::send_flags::sndmore);
    }
  }

  void send(const wire::Message& message) {
    send_frames({wire::encode({.header = next_header(), .message = message})});
  }

  [[nodiscard]] wire::Header next_header() {
    return {.session = session_, .epoch = epoch, .sequence = ++sequence_};
  }

  /// The next message of this kind; others are passed over. Takes over the epoch of a Welcome.
  template <typename Content>
  Content receive() {
    while (true) {
      wire::Packet packet = next_packet();
      if (auto* const content = std::get_if<Content>(&packet.message)) return *content;
    }
  }

  wire::Packet next_packet() {
    zmq::message_t frame;
    if (!socket_.recv(frame)) throw Error("no message before the deadline");
    auto packet = std::get<wire::Packet>(wire::decode(frame.to_string_view()));
    if (std::holds_alternative<wire::Welcome>(packet.message)) epoch = packet.header.epoch;
    return packet;
  }

  void say_hello() {
    const wire::Epoch known = std::exchange(epoch, wire::Epoch{});
    send(wire::Hello{.worker_name = fmt::format("w{}", session_.value),
                     .host = "here",
                     .process_id = session_.value,
                     .num_slots = 1,
                     .model_version = std::string(model_version),
                     .build = "test",
                     .former = {}});
    epoch = known;
  }

  wire::Welcome register_here() {
    say_hello();
    return receive<wire::Welcome>();
  }

  void want(std::uint32_t num_runs, const std::vector<wire::HeldRuns>& held = {}) {
    send(wire::Heartbeat{.num_runs_max = num_runs, .held = held, .computing = {}});
  }

  /// True if nothing but its acknowledgement follows a heartbeat that wants runs. A second one
  /// tells where the answer to the first ends.
  bool is_lent_nothing(const std::vector<wire::HeldRuns>& held = {}) {
    for (int i = 0; i < 2; ++i) {
      want(wire::runs_per_lease_max, held);
      if (!std::holds_alternative<wire::HeartbeatAck>(next_packet().message)) return false;
    }
    return true;
  }

  wire::RunLease borrow(std::uint32_t num_runs = 1) {
    (void)register_here();
    want(num_runs);
    return receive<wire::RunLease>();
  }

  void deliver(const wire::RunLease& lease, RunStatus status = RunStatus::completed) {
    wire::ResultBatch batch{.campaign = lease.campaign, .attempt = lease.attempt, .results = {}};
    for (std::uint64_t run = lease.runs.first.value; run < lease.runs.end(); ++run) {
      RunResult& result = batch.results.emplace_back().result;
      result.run = {run};
      result.status = status;
      result.num_draws = status == RunStatus::no_draw ? num_draws_max : 1;
      result.num_rounds = status == RunStatus::no_draw ? 0 : 1;
      result = drawn_result(std::move(result));
    }
    send(batch);
  }

  /// Computes all that is lent until told to stop.
  void work() {
    (void)register_here();
    want(wire::runs_per_lease_max);
    while (true) {
      const wire::Packet packet = next_packet();
      if (std::holds_alternative<wire::Stop>(packet.message)) return;
      if (const auto* const lease = std::get_if<wire::RunLease>(&packet.message)) deliver(*lease);
      if (std::holds_alternative<wire::ResultAck>(packet.message)) want(wire::runs_per_lease_max);
    }
  }

  [[nodiscard]] static wire::HeldRuns held(const wire::RunLease& lease) {
    return {.campaign = lease.campaign, .attempt = lease.attempt, .ranges = {lease.runs}};
  }

  wire::Epoch epoch;

 private:
  zmq::socket_t connected_socket() {
    zmq::socket_t socket = wire::make_dealer(context_, security_);
    socket.set(zmq::sockopt::linger, 0);
    socket.set(zmq::sockopt::immediate, false);  // What is sent before the connection waits for it.
    socket.set(zmq::sockopt::rcvtimeo, 20'000);
    socket.connect(endpoint_);
    return socket;
  }

  std::string endpoint_;
  wire::SessionId session_;
  wire::ClientSecurity security_;
  zmq::context_t context_;
  zmq::socket_t socket_;
  std::uint64_t sequence_ = 0;
};

}  // namespace proofmass::test
