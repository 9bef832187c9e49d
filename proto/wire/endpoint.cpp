#include "proto/wire/endpoint.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cstddef>
#include <initializer_list>

#include "core/error.hpp"

namespace proofmass::wire {
namespace {

/// A Unix domain socket's address holds 108 bytes, the last of them a zero.
constexpr std::size_t ipc_path_length_max = 107;

[[noreturn]] void refuse(std::string_view option, const std::string& endpoint,
                         std::string_view rule) {
  throw InvalidArgument(fmt::format("{} = {} ({})", option, endpoint, rule));
}

/// A decimal number, or `*`, with which the system chooses a port to bind.
bool is_port(std::string_view text) {
  if (text == "*") return true;
  unsigned port = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), port);
  return error == std::errc() && end == text.data() + text.size() && port >= 1 && port <= 65535;
}

void check_ipc(std::string_view option, const std::string& endpoint, std::string_view path) {
  if (path.empty() || path.size() > ipc_path_length_max) {
    refuse(option, endpoint, fmt::format("the path must have 1 to {} bytes", ipc_path_length_max));
  }
}

}  // namespace

void check_endpoint(std::string_view option, const std::string& endpoint) {
  const std::string_view text = endpoint;
  constexpr std::string_view ipc = "ipc://";
  if (text.starts_with(ipc)) return check_ipc(option, endpoint, text.substr(ipc.size()));
  if (!text.starts_with("tcp://")) {
    refuse(option, endpoint, "must be ipc://PATH or tcp://127.0.0.1:PORT");
  }
  for (const std::string_view host : {"tcp://127.0.0.1:", "tcp://[::1]:"}) {
    if (!text.starts_with(host)) continue;
    if (is_port(text.substr(host.size()))) return;
    refuse(option, endpoint, "the port must be in [1, 65535]");
  }
  refuse(option, endpoint,
         "must be on loopback, 127.0.0.1 or [::1]: connections are not encrypted");
}

}  // namespace proofmass::wire
