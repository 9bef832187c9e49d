#include "proto/link/init_system.hpp"

#include <sys/socket.h>
#include <sys/un.h>

#include <charconv>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <utility>

#include "proto/link/descriptor.hpp"

namespace proofmass::wire {
namespace {

constexpr std::chrono::seconds status_interval(5);

std::string environment(const char* name) {
  const char* const value = std::getenv(name);
  return value == nullptr ? "" : value;
}

/// The number that is the whole text; nothing if it is not one, or is 0.
std::optional<std::int64_t> positive_number(std::string_view text) {
  std::int64_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  const bool is_number = error == std::errc{} && end == text.data() + text.size();
  return is_number && number > 0 ? std::optional(number) : std::nullopt;
}

}  // namespace

InitSystem InitSystem::from_environment() {
  std::optional<std::chrono::microseconds> watchdog;
  if (const auto number = positive_number(environment("WATCHDOG_USEC"))) {
    watchdog = std::chrono::microseconds(*number);
  }
  return {environment("NOTIFY_SOCKET"), watchdog};
}

InitSystem::InitSystem(std::string socket, std::optional<std::chrono::microseconds> watchdog)
    : socket_(std::move(socket)), watchdog_(watchdog) {}

void InitSystem::notify(std::string_view lines) const {
  sockaddr_un address{};
  if (socket_.empty() || socket_.size() >= sizeof address.sun_path) return;
  address.sun_family = AF_UNIX;
  socket_.copy(address.sun_path, socket_.size());
  if (socket_.front() == '@') address.sun_path[0] = '\0';
  const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + socket_.size());
  const Descriptor file(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  [[maybe_unused]] const auto sent = sendto(file.number(), lines.data(), lines.size(), MSG_NOSIGNAL,
                                            reinterpret_cast<const sockaddr*>(&address), size);
}

std::optional<std::chrono::microseconds> InitSystem::watchdog_interval() const {
  if (!watchdog_) return std::nullopt;
  return *watchdog_ / 2;
}

ServiceNotices::ServiceNotices(InitSystem init_system) : init_system_(std::move(init_system)) {}

void ServiceNotices::ready() {
  if (!std::exchange(is_ready_, true)) init_system_.notify("READY=1");
}

void ServiceNotices::stopping() {
  if (!std::exchange(is_stopping_, true)) init_system_.notify("STOPPING=1");
}

void ServiceNotices::on_tick(TimePoint now, const std::function<std::string()>& status) {
  const auto watchdog = init_system_.watchdog_interval();
  if (watchdog && now >= watchdog_at_) {
    watchdog_at_ = now + *watchdog;
    init_system_.notify("WATCHDOG=1");
  }
  if (now < status_at_) return;
  status_at_ = now + status_interval;
  init_system_.notify("STATUS=" + status());
}

}  // namespace proofmass::wire
