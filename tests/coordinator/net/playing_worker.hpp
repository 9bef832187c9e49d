#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
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
#include "core/runs.hpp"
#include "proto/link/socket.hpp"
#include "proto/wire/codec.hpp"
#include "tests/support/drawn_result.hpp"
#include "tests/support/messages.hpp"

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

  template <typename Content>
  void send(const Content& content) {
    send_frames({wire::encode(next_envelope(content))});
  }

  /// The message as it would be sent next.
  template <typename Content>
  [[nodiscard]] proto::Envelope next_envelope(const Content& content) {
    proto::Envelope envelope = in_envelope(content);
    envelope.set_session(session_.value);
    envelope.set_epoch(epoch.value);
    envelope.set_sequence(++sequence_);
    return envelope;
  }

  /// The next message of this kind; others are passed over. Takes over the epoch of a Welcome.
  template <typename Content>
  Content receive() {
    while (true) {
      const proto::Envelope message = next_message();
      if (holds<Content>(message)) return content_of<Content>(message);
    }
  }

  proto::Envelope next_message() {
    zmq::message_t frame;
    if (!socket_.recv(frame)) throw Error("no message before the deadline");
    auto message = std::get<proto::Envelope>(wire::decode(frame.to_string_view()));
    if (message.has_welcome()) epoch = {message.epoch()};
    return message;
  }

  void say_hello() {
    const wire::Epoch known = std::exchange(epoch, wire::Epoch{});
    proto::Hello hello = make_hello(fmt::format("w{}", session_.value), "here", 1, model_version);
    hello.set_process_id(session_.value);
    send(hello);
    epoch = known;
  }

  proto::Welcome register_here() {
    say_hello();
    return receive<proto::Welcome>();
  }

  void want(std::uint32_t num_runs, const std::vector<proto::HeldRuns>& held = {}) {
    send(make_heartbeat(num_runs, held));
  }

  /// True if nothing but its acknowledgement follows a heartbeat that wants runs. A second one
  /// tells where the answer to the first ends.
  bool is_lent_nothing(const std::vector<proto::HeldRuns>& held = {}) {
    for (int i = 0; i < 2; ++i) {
      want(wire::runs_per_lease_max, held);
      if (!next_message().has_heartbeat_ack()) return false;
    }
    return true;
  }

  proto::RunLease borrow(std::uint32_t num_runs = 1) {
    (void)register_here();
    want(num_runs);
    return receive<proto::RunLease>();
  }

  void deliver(const proto::RunLease& lease, RunStatus status = RunStatus::completed) {
    std::vector<wire::ComputedRun> results;
    for (const RunIndex run : indices_of(std::array{wire::runs_of(lease)})) {
      RunResult& result = results.emplace_back().result;
      result.run = run;
      result.status = status;
      result.num_draws = status == RunStatus::no_draw ? num_draws_max : 1;
      result.num_rounds = status == RunStatus::no_draw ? 0 : 1;
      result = drawn_result(std::move(result));
    }
    send(make_result_batch({lease.campaign()}, {lease.attempt()}, results));
  }

  /// Computes all that is lent until told to stop.
  void work() {
    (void)register_here();
    want(wire::runs_per_lease_max);
    while (true) {
      const proto::Envelope message = next_message();
      if (message.has_stop()) return;
      if (message.has_run_lease()) deliver(message.run_lease());
      if (message.has_result_ack()) want(wire::runs_per_lease_max);
    }
  }

  [[nodiscard]] static proto::HeldRuns held(const proto::RunLease& lease) {
    return make_held({lease.campaign()}, {lease.attempt()}, {wire::runs_of(lease)});
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
