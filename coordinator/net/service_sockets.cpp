#include "coordinator/net/service_sockets.hpp"

#include <fmt/format.h>
#include <sys/resource.h>

#include <array>
#include <cerrno>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>
#include <zmq.hpp>

#include "coordinator/net/memory_guard.hpp"
#include "coordinator/net/router_socket.hpp"
#include "core/error.hpp"
#include "proto/link/key_files.hpp"
#include "proto/link/socket.hpp"
#include "proto/wire/endpoint.hpp"

namespace proofmass::coordinator {
namespace {

wire::ServerSecurity security_of(const ServiceConfig& config, wire::Domain domain) {
  if (config.keys) return wire::read_server_security(*config.keys, domain);
  return {.domain = domain, .keys = std::nullopt};
}

/// Socket of the clients, if there are any.
std::unique_ptr<RouterSocket> client_socket(zmq::context_t& context, const ServiceConfig& config) {
  if (!config.clients_endpoint) return nullptr;
  return std::make_unique<RouterSocket>(context, "bind-clients", *config.clients_endpoint,
                                        security_of(config, wire::Domain::clients), std::nullopt);
}

ServiceConfig checked(const ServiceConfig& config) {
  const auto protection = config.keys              ? wire::Protection::keys
                          : config.is_plain_waived ? wire::Protection::waived
                                                   : wire::Protection::none;
  wire::check_endpoint("bind", config.workers_endpoint, wire::EndpointUse::bind, protection);
  if (config.clients_endpoint) {
    wire::check_endpoint("bind-clients", *config.clients_endpoint, wire::EndpointUse::bind,
                         protection);
  }
  return config;
}

}  // namespace

class ServiceSockets::Impl {
 public:
  Impl(const ServiceConfig& config, Log log)
      : config_(checked(config)),
        log_(std::move(log)),
        authenticator_(make_authenticator()),
        workers_(context_, "bind", config.workers_endpoint,
                 security_of(config, wire::Domain::workers), config.faults),
        clients_(client_socket(context_, config)) {
    if (authenticator_ != nullptr) {
      authenticator_->watch(wire::Domain::workers, [this] { return workers_.take_event(); });
      if (clients_ != nullptr) {
        authenticator_->watch(wire::Domain::clients, [this] { return clients_->take_event(); });
      }
    }
    if (config.memory_size_max) {
      guard_.emplace(*config.memory_size_max,
                     MemoryGuard::Actions{.close = [this] { close(); },
                                          .open = [this] { return open(); },
                                          .note = [this](Event event) { note(event); }});
    }
  }

  [[nodiscard]] RouterSocket& workers() { return workers_; }
  [[nodiscard]] RouterSocket* clients() { return clients_.get(); }
  [[nodiscard]] Authenticator* authenticator() { return authenticator_.get(); }
  void wake() const { wake_.notify(); }

  void wait(std::chrono::milliseconds duration_max) {
    // Polled all the time, a socket would hardly ever be free for the guard.
    std::unique_lock lock(mutex_);
    closed_.wait(lock, [this] { return !is_closing_; });
    lock.unlock();
    const auto workers_held = workers_.hold();
    const auto clients_held =
        clients_ == nullptr ? std::unique_lock<std::mutex>() : clients_->hold();
    std::array<zmq::pollitem_t, 4> items{};
    std::size_t count = 0;
    const auto add = [&](void* socket) {
      if (socket != nullptr) items[count++] = {socket, 0, ZMQ_POLLIN, 0};
    };
    items[count++] = {nullptr, wake_.descriptor(), ZMQ_POLLIN, 0};
    add(workers_.handle());
    if (clients_ != nullptr) add(clients_->handle());
    if (authenticator_ != nullptr) add(authenticator_->handle());
    try {
      zmq::poll(items.data(), count, duration_max);
    } catch (const zmq::error_t& error) {
      if (error.num() != EINTR) throw Error(fmt::format("socket: {}", error.what()));
    }
  }

  void serve(TimePoint now) {
    (void)wake_.take();
    if (authenticator_ != nullptr) authenticator_->serve(now);
    for (const Event& event : take_notes()) log_(event);
  }

 private:
  /// Before any socket is bound, as it must be.
  std::unique_ptr<Authenticator> make_authenticator() {
    if (!config_.keys) return nullptr;
    return std::make_unique<Authenticator>(context_, *config_.keys,
                                           [this](const Event& event) { log_(event); });
  }

  // In the guard's thread.

  void close() {
    set_closing(true);
    wake_.notify();
    workers_.close();
    if (clients_ != nullptr) clients_->close();
    set_closing(false);
  }

  bool open() {
    const bool is_open = workers_.open();
    const bool has_clients = clients_ == nullptr || clients_->open();
    return is_open && has_clients;
  }

  void note(const Event& event) {
    {
      const std::lock_guard lock(mutex_);
      notes_.push_back(event);
    }
    wake_.notify();
  }

  void set_closing(bool is_closing) {
    {
      const std::lock_guard lock(mutex_);
      is_closing_ = is_closing;
    }
    closed_.notify_all();
  }

  // In any.

  std::vector<Event> take_notes() {
    const std::lock_guard lock(mutex_);
    return std::exchange(notes_, {});
  }

  ServiceConfig config_;
  Log log_;
  wire::Wake wake_;
  zmq::context_t context_;
  std::unique_ptr<Authenticator> authenticator_;
  RouterSocket workers_;
  std::unique_ptr<RouterSocket> clients_;
  std::mutex mutex_;  ///< For what follows.
  std::condition_variable closed_;
  bool is_closing_ = false;
  std::vector<Event> notes_;
  std::optional<MemoryGuard> guard_;  ///< Uses all the others: the last one.
};

ServiceSockets::ServiceSockets(const ServiceConfig& config, Log log)
    : impl_(std::make_unique<Impl>(config, std::move(log))) {}

ServiceSockets::~ServiceSockets() = default;

std::string ServiceSockets::workers_endpoint() const { return impl_->workers().endpoint(); }

std::string ServiceSockets::clients_endpoint() const {
  return impl_->clients() == nullptr ? "" : impl_->clients()->endpoint();
}

Authenticator* ServiceSockets::authenticator() { return impl_->authenticator(); }
void ServiceSockets::wait(std::chrono::milliseconds duration_max) { impl_->wait(duration_max); }
void ServiceSockets::wake() const { impl_->wake(); }
void ServiceSockets::serve(TimePoint now) { impl_->serve(now); }

void ServiceSockets::receive_from_workers(int count_max, TimePoint now, const Handle& handle) {
  impl_->workers().receive(count_max, now, handle);
}

void ServiceSockets::receive_from_clients(int count_max, TimePoint now, const Handle& handle) {
  if (impl_->clients() != nullptr) impl_->clients()->receive(count_max, now, handle);
}

bool ServiceSockets::send_to_worker(const std::string& routing_id, const std::string& bytes,
                                    TimePoint now) {
  return impl_->workers().send(routing_id, bytes, now);
}

bool ServiceSockets::send_to_client(const std::string& routing_id, const std::string& bytes,
                                    TimePoint now) {
  return impl_->clients() != nullptr && impl_->clients()->send(routing_id, bytes, now);
}

void raise_descriptor_limit() {
  rlimit limit{};
  PROOFMASS_EXPECT(getrlimit(RLIMIT_NOFILE, &limit) == 0);
  limit.rlim_cur = limit.rlim_max;
  // Where even this is forbidden, the service has what it was given.
  [[maybe_unused]] const int status = setrlimit(RLIMIT_NOFILE, &limit);
}

}  // namespace proofmass::coordinator
