#include "coordinator/net/authentication/authenticator.hpp"

#include <fmt/format.h>
#include <zmq.h>

#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>
#include <zmq.hpp>

#include "core/error.hpp"

namespace proofmass::coordinator {
namespace {

using wire::KeyRole;

constexpr const char* zap_address = "inproc://zeromq.zap.01";
constexpr std::string_view zap_version = "1.0";
constexpr std::size_t frames_max = 16;
constexpr std::size_t frame_size_max = 1024;
constexpr int requests_per_turn_max = 1000;  // Handshakes must not starve all else.
constexpr std::size_t key_size = 32;
constexpr std::size_t key_text_size = 40;

/// Takes one message whole, its later frames only as far as they can matter.
std::vector<std::string> receive_frames(zmq::socket_t& socket) {
  std::vector<std::string> frames;
  zmq::message_t frame;
  auto flags = zmq::recv_flags::dontwait;
  do {
    if (!socket.recv(frame, flags)) return frames;
    if (frames.size() < frames_max) {
      frames.push_back(frame.to_string().substr(0, frame_size_max));
    }
    flags = zmq::recv_flags::none;  // The parts of a message arrive together.
  } while (frame.more());
  return frames;
}

std::string z85(const std::string& key) {
  if (key.size() != key_size) return {};
  std::array<char, key_text_size + 1> text{};
  zmq_z85_encode(text.data(), reinterpret_cast<const std::uint8_t*>(key.data()), key.size());
  return text.data();
}

/// A question of ZeroMQ, by the order of its frames [RFC 27]; nothing if they are none.
std::optional<Handshake> handshake_in(const std::vector<std::string>& frames) {
  constexpr std::size_t num_fixed_frames = 6;
  if (frames.size() < num_fixed_frames || frames[0] != zap_version) return std::nullopt;
  const bool has_key = frames[5] == "CURVE" && frames.size() == num_fixed_frames + 1;
  return Handshake{.id = frames[1],
                   .domain = frames[2],
                   .address = frames[3],
                   .public_key = has_key ? z85(frames[num_fixed_frames]) : std::string()};
}

constexpr std::chrono::minutes period(1);
constexpr std::size_t lines_per_period_max = 20;

/// ZeroMQ writes an IPv4 address in the form of IPv6 if its socket has both.
std::string_view plain(std::string_view address) {
  constexpr std::string_view mapped = "::ffff:";
  const bool is_mapped = address.starts_with(mapped) && address.find('.') != std::string_view::npos;
  return is_mapped ? address.substr(mapped.size()) : address;
}

std::string_view or_else(std::string_view text, std::string_view substitute) {
  return text.empty() ? substitute : text;
}

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

}  // namespace

RefusalLog::RefusalLog(Log log) : log_(std::move(log)) {}

void RefusalLog::refused(const Handshake& peer, std::string_view reason, TimePoint now) {
  if (lines_.empty() || now - began_at_ >= period) begin_minute(now);
  Event event =
      Event::warning("peer_refused", {{"domain", or_else(peer.domain, "none")},
                                      {"address", or_else(plain(peer.address), "unknown")},
                                      {"key", or_else(peer.public_key, "none")},
                                      Field::reason(reason)});
  std::string line = to_text(event);
  if (lines_.contains(line)) return;
  if (lines_.size() >= lines_per_period_max) {
    ++num_left_out_;
    return;
  }
  lines_.insert(std::move(line));
  log_(std::move(event));
}

void RefusalLog::begin_minute(TimePoint now) {
  if (num_left_out_ > 0) {
    log_(Event::warning("peers_refused",
                        {{"count", num_left_out_}, Field::remark("without a line each")}));
  }
  num_left_out_ = 0;
  lines_.clear();
  began_at_ = now;
}

const int failed_handshakes =
    ZMQ_EVENT_HANDSHAKE_FAILED_PROTOCOL | ZMQ_EVENT_HANDSHAKE_FAILED_NO_DETAIL;

// Which end of a handshake without keys notices first is a matter of chance, so the coordinator
// sometimes sees no more than the end.
std::string_view reason_of(const wire::SocketEvent& event) {
  if (event.kind == ZMQ_EVENT_HANDSHAKE_FAILED_PROTOCOL) return protocol_reason(event.value);
  return event.value == EAGAIN ? "handshake takes too long"
                               : "leaves during the handshake: it ended, or has no key";
}

Authenticator::Authenticator(zmq::context_t& context, const std::filesystem::path& directory,
                             Log log)
    : refusals_(log),
      workers_(directory / list_name(KeyRole::worker), KeyRole::worker, log),
      clients_(directory / list_name(KeyRole::client), KeyRole::client, log),
      socket_(std::make_unique<zmq::socket_t>(context, zmq::socket_type::rep)) {
  try {
    socket_->bind(zap_address);
  } catch (const zmq::error_t& error) {
    throw Error(fmt::format("authenticator = {} ({})", zap_address, error.what()));
  }
}

Authenticator::~Authenticator() = default;

void* Authenticator::handle() const { return socket_->handle(); }

void Authenticator::on_event(KeyRole role, const wire::SocketEvent& event, TimePoint now) {
  if ((event.kind & failed_handshakes) == 0) return;
  refusals_.refused({.domain = domain_of(role)}, reason_of(event), now);
}

void Authenticator::serve(TimePoint now) {
  for (AllowList* const list : {&workers_, &clients_}) list->refresh_if_due(now);
  for (int i = 0; i < requests_per_turn_max; ++i) {
    const std::vector<std::string> frames = receive_frames(*socket_);
    if (frames.empty()) return;
    if (const auto handshake = handshake_in(frames)) {
      answer(*handshake, now);
    } else {
      reply(frames.size() > 1 ? frames[1] : "", "500", "malformed", "");
    }
  }
}

bool Authenticator::is_allowed(KeyRole role, std::string_view public_key, TimePoint now) {
  list_of(role).refresh_if_due(now);
  return list_of(role).owner_of(public_key) != nullptr;
}

std::optional<Asker> Authenticator::client(std::string_view public_key, TimePoint now) {
  if (!is_allowed(KeyRole::client, public_key, now)) return std::nullopt;
  return *clients_.owner_of(public_key);
}

AllowList& Authenticator::list_of(KeyRole role) {
  return role == KeyRole::worker ? workers_ : clients_;
}

void Authenticator::answer(const Handshake& handshake, TimePoint now) {
  const std::string_view reason = refusal(handshake, now);
  if (reason.empty()) return reply(handshake.id, "200", "OK", handshake.public_key);
  refusals_.refused(handshake, reason, now);
  reply(handshake.id, "400", "key not authorized", "");
}

std::string_view Authenticator::refusal(const Handshake& handshake, TimePoint now) {
  std::optional<KeyRole> role;
  for (const KeyRole known : {KeyRole::worker, KeyRole::client}) {
    if (handshake.domain == domain_of(known)) role = known;
  }
  if (!role) return "no such domain";
  if (handshake.public_key.empty()) return "without a key";
  list_of(*role).refresh(now);
  if (list_of(*role).owner_of(handshake.public_key) != nullptr) return {};
  const KeyRole other = *role == KeyRole::worker ? KeyRole::client : KeyRole::worker;
  if (list_of(other).owner_of(handshake.public_key) == nullptr) return "unknown key";
  return other == KeyRole::worker ? "key of a worker" : "key of a client";
}

void Authenticator::reply(std::string_view id, std::string_view status, std::string_view text,
                          std::string_view user_id) {
  const std::array<std::string_view, 6> frames{zap_version, id, status, text, user_id, ""};
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const bool is_last = i + 1 == frames.size();
    socket_->send(
        zmq::buffer(frames[i]),
        is_last ? zmq::send_flags::dontwait : zmq::send_flags::dontwait | zmq::send_flags::sndmore);
  }
}

}  // namespace proofmass::coordinator
