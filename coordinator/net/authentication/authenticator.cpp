#include "coordinator/net/authentication/authenticator.hpp"

#include <fmt/format.h>
#include <zmq.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>
#include <zmq.hpp>

#include "coordinator/net/authentication/allow_list.hpp"
#include "coordinator/net/authentication/refusal_log.hpp"
#include "core/error.hpp"

namespace proofmass::coordinator {
namespace {

using wire::Domain;

constexpr const char* zap_address = "inproc://zeromq.zap.01";
constexpr std::string_view zap_version = "1.0";
constexpr std::size_t frames_max = 16;
constexpr std::size_t frame_size_max = 1024;
constexpr int requests_per_turn_max = 1000;  // So that handshakes do not put off all else.
constexpr std::size_t key_size = 32;
constexpr std::size_t key_text_size = 40;

/// A question of ZeroMQ, by the order of its frames [RFC 27].
struct Request {
  std::string id;
  std::string domain;
  std::string address;
  std::string mechanism;
  std::string public_key;  ///< Z85; empty if the peer has none.
};

struct Answer {
  std::string_view status;  ///< 200: welcome; 400: not.
  std::string_view text;
  std::string user_id;
};

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

std::optional<Request> request_from(const std::vector<std::string>& frames) {
  constexpr std::size_t num_fixed_frames = 6;
  if (frames.size() < num_fixed_frames || frames[0] != zap_version) return std::nullopt;
  Request request{.id = frames[1],
                  .domain = frames[2],
                  .address = frames[3],
                  .mechanism = frames[5],
                  .public_key = {}};
  if (request.mechanism == "CURVE" && frames.size() == num_fixed_frames + 1) {
    request.public_key = z85(frames[num_fixed_frames]);
  }
  return request;
}

}  // namespace

class Authenticator::Impl {
 public:
  Impl(zmq::context_t& context, const std::filesystem::path& directory, Log log)
      : log_(std::move(log)),
        refusals_(log_),
        workers_(directory / wire::authorized_workers_name, Domain::workers),
        clients_(directory / wire::authorized_clients_name, Domain::clients),
        socket_(context, zmq::socket_type::rep) {
    try {
      socket_.bind(zap_address);
    } catch (const zmq::error_t& error) {
      throw Error(fmt::format("authenticator = {} ({})", zap_address, error.what()));
    }
  }

  [[nodiscard]] void* handle() { return socket_.handle(); }

  void watch(Domain domain, HandshakeWatch::EventSource next_event) {
    watches_.emplace_back(std::move(next_event), domain, refusals_);
  }

  void serve(TimePoint now) {
    for (HandshakeWatch& watch : watches_) watch.update(now);
    for (int i = 0; i < requests_per_turn_max; ++i) {
      const std::vector<std::string> frames = receive_frames(socket_);
      if (frames.empty()) return;
      const auto request = request_from(frames);
      if (request) {
        reply(request->id, answer(*request, now));
      } else {
        reply(frames.size() > 1 ? frames[1] : "",
              {.status = "500", .text = "malformed", .user_id = {}});
      }
    }
  }

  [[nodiscard]] bool is_allowed(Domain domain, std::string_view public_key, TimePoint now) {
    report(list_of(domain).refresh_if_due(now));
    return list_of(domain).owner_of(public_key) != nullptr;
  }

  [[nodiscard]] std::string name_of(Domain domain, std::string_view public_key) {
    const AllowedKey* const owner = list_of(domain).owner_of(public_key);
    return owner == nullptr ? std::string() : owner->name;
  }

  [[nodiscard]] std::optional<Asker> client(std::string_view public_key, TimePoint now) {
    if (!is_allowed(Domain::clients, public_key, now)) return std::nullopt;
    const AllowedKey& owner = *clients_.owner_of(public_key);
    return Asker{.name = owner.name, .rights = owner.rights};
  }

 private:
  [[nodiscard]] AllowList& list_of(Domain domain) {
    return domain == Domain::workers ? workers_ : clients_;
  }

  [[nodiscard]] Answer answer(const Request& request, TimePoint now) {
    const std::string_view reason = refusal(request);
    if (reason.empty()) return {.status = "200", .text = "OK", .user_id = request.public_key};
    refusals_.refused({.domain = request.domain,
                       .address = request.address,
                       .public_key = request.public_key,
                       .reason = reason},
                      now);
    return {.status = "400", .text = "key not authorized", .user_id = {}};
  }

  /// Why the peer may not come in; empty if it may.
  [[nodiscard]] std::string_view refusal(const Request& request) {
    std::optional<Domain> domain;
    for (const Domain known : {Domain::workers, Domain::clients}) {
      if (request.domain == to_text(known)) domain = known;
    }
    if (!domain) return "no such domain";
    if (request.public_key.empty()) return "without a key";
    report(list_of(*domain).refresh());
    if (list_of(*domain).owner_of(request.public_key) != nullptr) return {};
    const Domain other = *domain == Domain::workers ? Domain::clients : Domain::workers;
    if (list_of(other).owner_of(request.public_key) == nullptr) return "unknown key";
    return other == Domain::workers ? "key of a worker" : "key of a client";
  }

  void reply(std::string_view id, const Answer& answer) {
    const std::array<std::string_view, 6> frames{zap_version,    id, answer.status, answer.text,
                                                 answer.user_id, ""};
    for (std::size_t i = 0; i < frames.size(); ++i) {
      const bool is_last = i + 1 == frames.size();
      socket_.send(zmq::buffer(frames[i]),
                   is_last ? zmq::send_flags::dontwait
                           : zmq::send_flags::dontwait | zmq::send_flags::sndmore);
    }
  }

  void report(const std::optional<std::string>& what_is_wrong) {
    if (!what_is_wrong) return;
    log_({.severity = Severity::error,
          .kind = "allow_list_unreadable",
          .fields = {Field::remark(*what_is_wrong + "; the list before it stands")}});
  }

  Log log_;
  RefusalLog refusals_;
  AllowList workers_;
  AllowList clients_;
  zmq::socket_t socket_;
  std::vector<HandshakeWatch> watches_;
};

Authenticator::Authenticator(zmq::context_t& context, const std::filesystem::path& directory,
                             Log log)
    : impl_(std::make_unique<Impl>(context, directory, std::move(log))) {}

Authenticator::~Authenticator() = default;

void* Authenticator::handle() const { return impl_->handle(); }
void Authenticator::watch(Domain domain, HandshakeWatch::EventSource next_event) {
  impl_->watch(domain, std::move(next_event));
}
void Authenticator::serve(TimePoint now) { impl_->serve(now); }

bool Authenticator::is_allowed(Domain domain, std::string_view public_key, TimePoint now) {
  return impl_->is_allowed(domain, public_key, now);
}

std::string Authenticator::name_of(Domain domain, std::string_view public_key) const {
  return impl_->name_of(domain, public_key);
}

std::optional<Asker> Authenticator::client(std::string_view public_key, TimePoint now) {
  return impl_->client(public_key, now);
}

}  // namespace proofmass::coordinator
