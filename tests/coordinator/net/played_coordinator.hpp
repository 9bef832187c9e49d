#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <variant>
#include <zmq.hpp>

#include "core/error.hpp"
#include "proto/link/socket.hpp"
#include "proto/wire/client_codec.hpp"

namespace proofmass::test {

/// A coordinator's socket; every receive has a deadline.
class PlayedCoordinator {
 public:
  explicit PlayedCoordinator(const std::string& endpoint)
      : socket_(wire::make_router(context_, "bind", endpoint, {})) {
    socket_.set(zmq::sockopt::linger, 0);
    socket_.set(zmq::sockopt::rcvtimeo, 20'000);
  }

  /// The next request; whoever sent it is answered from now on.
  proto::RequestEnvelope receive() {
    zmq::message_t bytes;
    if (!socket_.recv(client_) || !socket_.recv(bytes)) throw Error("no request");
    return std::get<proto::RequestEnvelope>(wire::decode_request(bytes.to_string_view()));
  }

  void answer(const std::string& bytes) {
    (void)socket_.send(zmq::buffer(client_.to_string()), zmq::send_flags::sndmore);
    (void)socket_.send(zmq::buffer(bytes), zmq::send_flags::none);
  }
  void answer(std::uint64_t id, proto::ReplyEnvelope reply) {
    reply.set_request_id(id);
    answer(wire::encode(std::move(reply)));
  }
  void answer(std::uint64_t id, const std::string& text) { answer(id, wire::done_reply(text)); }

 private:
  zmq::context_t context_;
  zmq::socket_t socket_;
  zmq::message_t client_;
};

}  // namespace proofmass::test
