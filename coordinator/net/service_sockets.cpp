#include "coordinator/net/service_sockets.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <malloc.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <utility>
#include <zmq.hpp>

#include "core/error.hpp"
#include "proto/link/keys.hpp"
#include "proto/wire/endpoint.hpp"

namespace proofmass::coordinator {
namespace {

using Clock = std::chrono::steady_clock;

// One connection on the same machine can bring in about a gigabyte a second.
constexpr std::chrono::milliseconds look_interval(25);
// ZeroMQ frees what a closed socket held in threads of its own: it is done when nothing more comes.
constexpr std::chrono::milliseconds settled_after(100);
constexpr std::chrono::seconds settle_time_max(3);
// Peers that do have keys get in again meanwhile, and others are cut off.
constexpr std::chrono::seconds descriptors_pause(5);

std::size_t mebibytes(std::size_t size) { return size >> 20; }

wire::ServerSecurity security_of(const ServiceConfig& config, wire::KeyRole peers) {
  if (config.keys) return wire::read_server_security(*config.keys, peers);
  return {.peers = peers, .keys = std::nullopt};
}

void check_endpoints(const ServiceConfig& config) {
  const wire::Protection protection = wire::protection_by(config.keys, config.is_plain_waived);
  wire::check_endpoint("bind", config.workers_endpoint, wire::EndpointUse::bind, protection);
  if (!config.clients_endpoint) return;
  wire::check_endpoint("bind-clients", *config.clients_endpoint, wire::EndpointUse::bind,
                       protection);
}

/// What is kept for files, and for each kind of peers.
std::uint64_t share_of(std::uint64_t num_descriptors) {
  constexpr std::uint64_t share_max = 64;
  return std::min(num_descriptors / 8, share_max);
}

}  // namespace

Descriptors shared_out(std::uint64_t limit, std::uint64_t num_reserved, int num_open) {
  const std::uint64_t left = limit - std::min(num_reserved, limit);
  const std::uint64_t share = share_of(left);
  const std::uint64_t taken = 2 * share + static_cast<std::uint64_t>(num_open);
  const std::uint64_t alarm =
      std::min<std::uint64_t>(left - share, std::numeric_limits<int>::max());
  return {.limit = limit,
          .num_workers_max = left - std::min(taken, left),
          .alarm = static_cast<int>(alarm)};
}

bool has_room_for_campaign(std::uint64_t limit, std::uint64_t num_reserved,
                           std::uint64_t num_open) {
  const std::uint64_t left = limit - std::min(num_reserved, limit);
  return num_open + descriptors_per_campaign + 3 * share_of(left) <= left;
}

void require_room_for_campaign(std::string_view what, std::uint64_t num_reserved) {
  const std::uint64_t limit = raise_descriptor_limit();
  const auto num_open = static_cast<std::uint64_t>(lowest_free_descriptor());
  if (has_room_for_campaign(limit, num_reserved, num_open)) return;
  throw Error(fmt::format(
      "{} (takes {} descriptors, for which the coordinator's limit of {} open files has no room "
      "beside other campaigns, workers and clients; raise `ulimit -n` or LimitNOFILE there)",
      what, descriptors_per_campaign, limit));
}

std::uint64_t raise_descriptor_limit() {
  rlimit limit{};
  PROOFMASS_EXPECT(getrlimit(RLIMIT_NOFILE, &limit) == 0);
  const rlim_t before = limit.rlim_cur;
  limit.rlim_cur = limit.rlim_max;
  // Where even this is forbidden, the service has what it was given.
  return setrlimit(RLIMIT_NOFILE, &limit) == 0 ? limit.rlim_cur : before;
}

int lowest_free_descriptor() {
  const wire::Descriptor lowest(open("/dev/null", O_RDONLY | O_CLOEXEC));
  return lowest.number() < 0 ? std::numeric_limits<int>::max() : lowest.number();
}

bool MemoryBound::is_exceeded(std::size_t size) {
  if (size <= alarm_size_) {
    limit_ = alarm_size_;
    is_high_ = false;
  }
  return size > limit_;
}

bool MemoryBound::note_reset(std::size_t size) {
  if (size <= alarm_size_) return false;
  limit_ = size + size / 4;
  return !std::exchange(is_high_, true);
}

ResidentMemory::ResidentMemory() : file_(open("/proc/self/statm", O_RDONLY | O_CLOEXEC)) {
  if (file_.number() < 0) throw Error(fmt::format("/proc/self/statm: {}", std::strerror(errno)));
}

std::size_t ResidentMemory::size() const {
  // In pages: the size of the address space, what of it is resident.
  std::array<char, 128> text{};
  const ssize_t length = pread(file_.number(), text.data(), text.size() - 1, 0);
  PROOFMASS_EXPECT(length > 0);
  char* after_first = nullptr;
  (void)std::strtoull(text.data(), &after_first, 10);
  return std::strtoull(after_first, nullptr, 10) * static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
}

MemoryGuard::MemoryGuard(std::size_t size_max, Actions actions)
    : bound_(size_max),
      size_max_(size_max),
      actions_(std::move(actions)),
      thread_([this] { watch(); }) {}

MemoryGuard::~MemoryGuard() {
  {
    const std::lock_guard lock(mutex_);
    is_stopping_ = true;
  }
  stopping_.notify_all();
  thread_.join();
}

void MemoryGuard::watch() {
  Clock::time_point descriptors_at{};
  while (!is_stopping_after(look_interval)) {
    if (!is_open_) open();
    const std::size_t size = memory_.size();
    if (bound_.is_exceeded(size)) reset(size, "(peers connect anew)");
    if (Clock::now() < descriptors_at || !actions_.lacks_descriptors()) continue;
    reset(size, "(descriptors were lacking; peers connect anew)");
    descriptors_at = Clock::now() + descriptors_pause;
  }
}

void MemoryGuard::reset(std::size_t size_before, std::string_view reason) {
  actions_.close();
  const std::size_t size = settled_size();
  is_open_ = actions_.open();
  const bool is_news = bound_.note_reset(size);
  note("sockets_reset", {{"resident_mib", mebibytes(size_before)},
                         {"left_mib", mebibytes(size)},
                         {"memory_max_mib", mebibytes(size_max_)},
                         Field::remark(std::string(reason))});
  if (is_news) {
    note("memory_high", {{"resident_mib", mebibytes(size)},
                         {"memory_max_mib", mebibytes(size_max_)},
                         Field::remark(fmt::format("(not held by sockets; next reset at {} MiB)",
                                                   mebibytes(bound_.limit())))});
  }
  if (!is_open_) {
    note("sockets_unbound", {Field::remark("an address is taken; tried again until it is free")});
  }
}

void MemoryGuard::open() {
  is_open_ = actions_.open();
  if (is_open_) note("sockets_bound", {});
}

std::size_t MemoryGuard::settled_size() {
  const auto begin = Clock::now();
  auto shrunk_at = begin;
  std::size_t smallest = memory_.size();
  for (;;) {
    malloc_trim(0);
    const std::size_t size = memory_.size();
    const auto now = Clock::now();
    if (size < smallest) shrunk_at = now;
    smallest = std::min(smallest, size);
    const bool is_settled = now - shrunk_at > settled_after || now - begin > settle_time_max;
    if (is_settled || is_stopping_after(look_interval)) return size;
  }
}

void MemoryGuard::note(std::string_view kind, wire::Fields fields) const {
  actions_.note({.severity = kind == "sockets_unbound" ? Severity::error : Severity::warning,
                 .kind = kind,
                 .fields = std::move(fields)});
}

bool MemoryGuard::is_stopping_after(Clock::duration duration) {
  std::unique_lock lock(mutex_);
  return stopping_.wait_for(lock, duration, [this] { return is_stopping_; });
}

ServiceSockets::ServiceSockets(const ServiceConfig& config, Log log)
    : log_(std::move(log)), context_(std::make_unique<zmq::context_t>()) {
  check_endpoints(config);
  if (config.keys) authenticator_ = std::make_unique<Authenticator>(*context_, *config.keys, log_);
  workers_ = std::make_unique<RouterSocket>(*context_, "bind", config.workers_endpoint,
                                            security_of(config, wire::KeyRole::worker),
                                            config.workers_listener);
  if (config.clients_endpoint) {
    clients_ = std::make_unique<RouterSocket>(*context_, "bind-clients", *config.clients_endpoint,
                                              security_of(config, wire::KeyRole::client));
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
    const auto hand_on_events = [&](wire::KeyRole peers, RouterSocket& socket) {
      while (const auto event = socket.take_event()) authenticator_->on_event(peers, *event, now);
    };
    hand_on_events(wire::KeyRole::worker, *workers_);
    if (clients_ != nullptr) hand_on_events(wire::KeyRole::client, *clients_);
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
