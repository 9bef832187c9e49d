#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <variant>
#include <vector>
#include <zmq.hpp>

#include "core/error.hpp"
#include "proto/link/socket.hpp"
#include "proto/wire/client_codec.hpp"

namespace proofmass::test {

/// A client's socket; every receive has a deadline.
class PlayingClient {
 public:
  explicit PlayingClient(const std::string& endpoint, const wire::ClientSecurity& security = {})
      : socket_(wire::make_dealer(context_, security)) {
    socket_.set(zmq::sockopt::linger, 0);
    socket_.set(zmq::sockopt::immediate, false);
    socket_.set(zmq::sockopt::rcvtimeo, 20'000);
    socket_.connect(endpoint);
  }

  void send(const std::vector<std::string>& frames) {
    for (std::size_t i = 0; i < frames.size(); ++i) {
      const bool is_last = i + 1 == frames.size();
      (void)socket_.send(zmq::buffer(frames[i]),
                         is_last ? zmq::send_flags::none : zmq::send_flags::sndmore);
    }
  }
  void send(std::uint64_t id, const wire::ClientRequest& request) {
    send({wire::encode(wire::RequestPacket{.id = id, .request = request})});
  }

  wire::ReplyPacket receive() {
    zmq::message_t frame;
    if (!socket_.recv(frame)) throw Error("no reply before the deadline");
    return std::get<wire::ReplyPacket>(wire::decode_reply(frame.to_string_view()));
  }
  /// The next that is no sign of life.
  wire::ReplyPacket receive_final() {
    for (;;) {
      wire::ReplyPacket packet = receive();
      if (!std::holds_alternative<wire::WaitReply>(packet.reply)) return packet;
    }
  }

  wire::ReplyPacket ask_bytes(const std::vector<std::string>& frames) {
    send(frames);
    return receive_final();
  }

  wire::ClientReply ask(const wire::ClientRequest& request) {
    send(++id_, request);
    const wire::ReplyPacket packet = receive_final();
    EXPECT_EQ(packet.id, id_);
    return packet.reply;
  }

  std::string done(const wire::ClientRequest& request) {
    const wire::ClientReply reply = ask(request);
    const auto* const error = std::get_if<wire::ErrorReply>(&reply);
    return error != nullptr ? "error: " + error->text : std::get<wire::DoneReply>(reply).text;
  }
  std::string error(const wire::ClientRequest& request) {
    return std::get<wire::ErrorReply>(ask(request)).text;
  }
  wire::StatusReply status() { return std::get<wire::StatusReply>(ask(wire::StatusRequest{})); }

 private:
  zmq::context_t context_;
  zmq::socket_t socket_;
  std::uint64_t id_ = 0;
};

}  // namespace proofmass::test
