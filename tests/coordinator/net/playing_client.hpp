#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <utility>
#include <variant>
#include <vector>
#include <zmq.hpp>

#include "core/error.hpp"
#include "proto/link/socket.hpp"
#include "proto/wire/client_codec.hpp"
#include "tests/proto/wire/requests.hpp"

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
  void send(std::uint64_t id, proto::RequestEnvelope request) {
    request.set_request_id(id);
    send({wire::encode(std::move(request))});
  }

  proto::ReplyEnvelope receive() {
    zmq::message_t frame;
    if (!socket_.recv(frame)) throw Error("no reply before the deadline");
    return std::get<proto::ReplyEnvelope>(wire::decode_reply(frame.to_string_view()));
  }
  /// The next that is no sign of life.
  proto::ReplyEnvelope receive_final() {
    for (;;) {
      proto::ReplyEnvelope reply = receive();
      if (!reply.has_wait()) return reply;
    }
  }

  proto::ReplyEnvelope ask_bytes(const std::vector<std::string>& frames) {
    send(frames);
    return receive_final();
  }

  proto::ReplyEnvelope ask(const proto::RequestEnvelope& request) {
    send(++id_, request);
    proto::ReplyEnvelope reply = receive_final();
    EXPECT_EQ(reply.request_id(), id_);
    return reply;
  }

  std::string done(const proto::RequestEnvelope& request) {
    const proto::ReplyEnvelope reply = ask(request);
    if (reply.has_error()) return "error: " + reply.error().text();
    EXPECT_TRUE(reply.has_done());
    return reply.done().text();
  }
  std::string error(const proto::RequestEnvelope& request) {
    const proto::ReplyEnvelope reply = ask(request);
    EXPECT_TRUE(reply.has_error());
    return reply.error().text();
  }
  proto::StatusReply status(std::uint64_t first_campaign = 0) {
    proto::RequestEnvelope request;
    request.mutable_status()->set_first_campaign(first_campaign);
    const proto::ReplyEnvelope reply = ask(request);
    EXPECT_TRUE(reply.has_status());
    return reply.status();
  }

 private:
  zmq::context_t context_;
  zmq::socket_t socket_;
  std::uint64_t id_ = 0;
};

}  // namespace proofmass::test
