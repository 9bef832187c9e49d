#include "proto/wire/endpoint.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "core/error.hpp"

namespace proofmass::wire {
namespace {

constexpr std::string_view ipc_prefix = "ipc://";
constexpr std::string_view tcp_prefix = "tcp://";

/// A Unix domain socket's address holds 108 bytes, the last of them a zero.
constexpr std::size_t ipc_path_length_max = 107;
constexpr std::size_t host_name_length_max = 253;

enum class HostKind : std::uint8_t { any, ipv4, ipv6, name };

struct Host {
  HostKind kind = HostKind::name;
  bool is_loopback = false;
};

[[noreturn]] void refuse(std::string_view option, const std::string& endpoint,
                         std::string_view rule) {
  throw InvalidArgument(fmt::format("{} = {} ({})", option, endpoint, rule));
}

void check_ipc(std::string_view option, const std::string& endpoint) {
  const std::size_t length = endpoint.size() - ipc_prefix.size();
  if (length >= 1 && length <= ipc_path_length_max) return;
  refuse(option, endpoint, fmt::format("the path must have 1 to {} bytes", ipc_path_length_max));
}

bool is_port(std::string_view text, EndpointUse use) {
  if (use == EndpointUse::bind && text == "*") return true;
  unsigned port = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), port);
  return error == std::errc() && end == text.data() + text.size() && port >= 1 && port <= 65535;
}

bool is_host_name(std::string_view text) {
  const auto is_part = [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '.' || c == '-' || c == '_';
  };
  return !text.empty() && text.size() <= host_name_length_max && std::ranges::all_of(text, is_part);
}

std::optional<Host> ipv6_host(std::string_view bracketed) {
  const std::string text(bracketed.substr(1, bracketed.size() - 2));
  in6_addr address{};
  if (inet_pton(AF_INET6, text.c_str(), &address) != 1) return std::nullopt;
  return Host{.kind = HostKind::ipv6, .is_loopback = IN6_IS_ADDR_LOOPBACK(&address) != 0};
}

/// Nothing if the text is no host at all.
std::optional<Host> parse_host(std::string_view text) {
  if (text == "*") return Host{.kind = HostKind::any};
  if (text.starts_with('[') && text.ends_with(']')) return ipv6_host(text);
  in_addr address{};
  if (inet_pton(AF_INET, std::string(text).c_str(), &address) == 1) {
    constexpr std::uint32_t loopback_network = 127;
    return Host{.kind = HostKind::ipv4,
                .is_loopback = ntohl(address.s_addr) >> 24 == loopback_network};
  }
  if (is_host_name(text)) return Host{.kind = HostKind::name};
  return std::nullopt;
}

struct TcpParts {
  std::string_view host;
  std::string_view port;
};

/// Splits what follows `tcp://` at its last colon.
TcpParts split(std::string_view address) {
  const std::size_t colon = address.rfind(':');
  if (colon == std::string_view::npos) return {.host = address, .port = {}};
  return {.host = address.substr(0, colon), .port = address.substr(colon + 1)};
}

std::optional<Host> host_of(std::string_view endpoint) {
  if (!endpoint.starts_with(tcp_prefix)) return std::nullopt;
  return parse_host(split(endpoint.substr(tcp_prefix.size())).host);
}

void check_tcp(std::string_view option, const std::string& endpoint, EndpointUse use,
               Protection protection) {
  const TcpParts parts = split(std::string_view(endpoint).substr(tcp_prefix.size()));
  const auto host = parse_host(parts.host);
  if (!host || (use == EndpointUse::connect && host->kind == HostKind::any)) {
    refuse(option, endpoint, "the host must be a name, an IPv4 address or [IPv6]");
  }
  if (!is_port(parts.port, use)) refuse(option, endpoint, "the port must be in [1, 65535]");
  if (host->is_loopback || protection != Protection::none) return;
  refuse(option, endpoint, "needs --keys, or --insecure-plain on a network that you trust");
}

}  // namespace

void check_endpoint(std::string_view option, const std::string& endpoint, EndpointUse use,
                    Protection protection) {
  if (endpoint.find('\0') != std::string::npos) {
    refuse(option, "", "must not have a zero byte");
  }
  if (endpoint.starts_with(ipc_prefix)) return check_ipc(option, endpoint);
  if (endpoint.starts_with(tcp_prefix)) return check_tcp(option, endpoint, use, protection);
  refuse(option, endpoint, "must be ipc://PATH or tcp://HOST:PORT");
}

bool is_local(const std::string& endpoint) {
  if (endpoint.starts_with(ipc_prefix)) return true;
  const auto host = host_of(endpoint);
  return host && host->is_loopback;
}

bool may_be_ipv6(const std::string& endpoint, EndpointUse use) {
  const auto host = host_of(endpoint);
  if (!host || host->kind == HostKind::ipv4) return false;
  // A name to bind is a network interface's, of which the IPv4 address is meant.
  return host->kind != HostKind::name || use == EndpointUse::connect;
}

}  // namespace proofmass::wire
