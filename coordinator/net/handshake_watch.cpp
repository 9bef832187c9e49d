#include "coordinator/net/handshake_watch.hpp"

#include <zmq.h>

#include <cerrno>
#include <cstdint>
#include <string_view>

#include "proto/link/socket_events.hpp"

namespace proofmass::coordinator {
namespace {

constexpr int watched_events =
    ZMQ_EVENT_HANDSHAKE_FAILED_PROTOCOL | ZMQ_EVENT_HANDSHAKE_FAILED_NO_DETAIL;

std::string_view protocol_reason(std::uint32_t error) {
  switch (error) {
    case ZMQ_PROTOCOL_ERROR_ZMTP_MECHANISM_MISMATCH:
      return "without a key";
    case ZMQ_PROTOCOL_ERROR_ZMTP_CRYPTOGRAPHIC:
    case ZMQ_PROTOCOL_ERROR_ZMTP_KEY_EXCHANGE:
      return "trusts the key of another coordinator";
    default:
      return "breaks the rules of the handshake";
  }
}

/// Which end of a handshake without keys notices first is a matter of chance, so the coordinator
/// sometimes sees no more than the end.
std::string_view reason_of(const wire::SocketEvent& event) {
  if (event.kind == ZMQ_EVENT_HANDSHAKE_FAILED_PROTOCOL) return protocol_reason(event.value);
  return event.value == EAGAIN ? "handshake takes too long"
                               : "ends during the handshake, as one without a key does";
}

}  // namespace

class HandshakeWatch::Parts {
 public:
  Parts(zmq::context_t& context, void* router, wire::Domain domain, RefusalLog& log)
      : events_(context, router, watched_events), domain_(domain), log_(log) {}

  void update(TimePoint now) {
    while (const auto event = events_.take()) {
      if ((event->kind & watched_events) == 0) continue;  // The monitor's own end.
      log_.refused({.domain = to_text(domain_),
                    .address = {},
                    .public_key = {},
                    .reason = reason_of(*event)},
                   now);
    }
  }

 private:
  wire::SocketEvents events_;
  wire::Domain domain_;
  RefusalLog& log_;
};

HandshakeWatch::HandshakeWatch(zmq::context_t& context, void* router, wire::Domain domain,
                               RefusalLog& log)
    : parts_(std::make_unique<Parts>(context, router, domain, log)) {}

HandshakeWatch::~HandshakeWatch() = default;

void HandshakeWatch::update(TimePoint now) { parts_->update(now); }

}  // namespace proofmass::coordinator
