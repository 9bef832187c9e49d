#include "coordinator/net/service_sockets.hpp"

#include <fmt/format.h>

#include <array>
#include <cerrno>
#include <utility>
#include <zmq.hpp>

#include "core/error.hpp"
#include "proto/link/keys.hpp"
#include "proto/wire/endpoint.hpp"

namespace proofmass::coordinator {
namespace {

wire::ServerSecurity security_of(const ServiceConfig& config, wire::Domain domain) {
  if (config.keys) return wire::read_server_security(*config.keys, domain);
  return {.domain = domain, .keys = std::nullopt};
}

void check_endpoints(const ServiceConfig& config) {
  const wire::Protection protection = wire::protection_by(config.keys, config.is_plain_waived);
  wire::check_endpoint("bind", config.workers_endpoint, wire::EndpointUse::bind, protection);
  if (!config.clients_endpoint) return;
  wire::check_endpoint("bind-clients", *config.clients_endpoint, wire::EndpointUse::bind,
                       protection);
}

}  // namespace

ServiceSockets::ServiceSockets(const ServiceConfig& config, Log log)
    : log_(std::move(log)), context_(std::make_unique<zmq::context_t>()) {
  check_endpoints(config);
  if (config.keys) authenticator_ = std::make_unique<Authenticator>(*context_, *config.keys, log_);
  workers_ = std::make_unique<RouterSocket>(*context_, "bind", config.workers_endpoint,
                                            security_of(config, wire::Domain::workers),
                                            config.workers_listener);
  if (config.clients_endpoint) {
    clients_ = std::make_unique<RouterSocket>(*context_, "bind-clients", *config.clients_endpoint,
                                              security_of(config, wire::Domain::clients));
  }
  descriptors_ = shared_out(raise_descriptor_limit(), config.num_descriptors_reserved,
                            lowest_free_descriptor());
  if (!config.memory_size_max) return;
  guard_.emplace(*config.memory_size_max,
                 MemoryGuard::Actions{
                     .close = [this] { close(); },
                     .open = [this] { return open(); },
                     .lacks_descriptors =
                         [end = descriptors_.alarm] { return lowest_free_descriptor() >= end; },
                     .note = [this](Event event) { note(std::move(event)); }});
}

ServiceSockets::~ServiceSockets() = default;

void ServiceSockets::wait(std::chrono::milliseconds duration_max) {
  // Polled all the time, a socket would hardly ever be free for the guard.
  std::unique_lock lock(mutex_);
  closed_.wait(lock, [this] { return !is_closing_; });
  lock.unlock();
  const auto workers_held = workers_->hold();
  const auto clients_held = clients_ == nullptr ? std::unique_lock<std::mutex>() : clients_->hold();
  std::array<zmq::pollitem_t, 4> items{};
  std::size_t count = 0;
  const auto add = [&](void* socket) {
    if (socket != nullptr) items[count++] = {socket, 0, ZMQ_POLLIN, 0};
  };
  items[count++] = {nullptr, wake_.descriptor(), ZMQ_POLLIN, 0};
  add(workers_->handle());
  if (clients_ != nullptr) add(clients_->handle());
  if (authenticator_ != nullptr) add(authenticator_->handle());
  try {
    zmq::poll(items.data(), count, duration_max);
  } catch (const zmq::error_t& error) {
    if (error.num() != EINTR) throw Error(fmt::format("socket: {}", error.what()));
  }
}

void ServiceSockets::serve(TimePoint now) {
  (void)wake_.take();
  if (authenticator_ != nullptr) {
    const auto hand_on_events = [&](wire::Domain domain, RouterSocket& socket) {
      while (const auto event = socket.take_event()) authenticator_->on_event(domain, *event, now);
    };
    hand_on_events(wire::Domain::workers, *workers_);
    if (clients_ != nullptr) hand_on_events(wire::Domain::clients, *clients_);
    authenticator_->serve(now);
  }
  std::unique_lock lock(mutex_);
  const std::vector<Event> notes = std::exchange(notes_, {});
  lock.unlock();
  for (const Event& event : notes) log_(event);
}

void ServiceSockets::close() {
  ++num_resets_;
  set_closing(true);
  wake_.notify();
  workers_->close();
  if (clients_ != nullptr) clients_->close();
  set_closing(false);
}

bool ServiceSockets::open() {
  const bool is_open = workers_->open();
  const bool has_clients = clients_ == nullptr || clients_->open();
  return is_open && has_clients;
}

void ServiceSockets::note(Event event) {
  {
    const std::lock_guard lock(mutex_);
    notes_.push_back(std::move(event));
  }
  wake_.notify();
}

void ServiceSockets::set_closing(bool is_closing) {
  {
    const std::lock_guard lock(mutex_);
    is_closing_ = is_closing;
  }
  closed_.notify_all();
}

}  // namespace proofmass::coordinator
