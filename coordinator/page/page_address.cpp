#include "coordinator/page/page_address.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>

#include <charconv>
#include <system_error>

#include "core/error.hpp"

namespace proofmass::coordinator {
namespace {

[[noreturn]] void refuse_page_address(std::string_view text) {
  throw InvalidArgument(
      fmt::format("page = {} (must be HOST:PORT, with localhost, * or the address of an interface "
                  "and a port up to 65535; IPv6 in brackets)",
                  text));
}

std::uint16_t port_in(std::string_view digits, std::string_view text) {
  std::uint16_t port = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), port);
  if (error != std::errc() || end != digits.data() + digits.size()) refuse_page_address(text);
  return port;
}

}  // namespace

PageAddress parse_page_address(std::string_view text) {
  const std::size_t colon = text.rfind(':');
  if (colon == std::string_view::npos) refuse_page_address(text);
  std::string host(text.substr(0, colon));
  const std::uint16_t port = port_in(text.substr(colon + 1), text);
  if (host == "localhost") host = "127.0.0.1";
  if (host == "*") host = "0.0.0.0";
  in_addr ipv4{};
  if (inet_pton(AF_INET, host.c_str(), &ipv4) == 1) {
    constexpr std::uint32_t loopback_network = 127;
    return {
        .host = host, .port = port, .is_loopback = ntohl(ipv4.s_addr) >> 24 == loopback_network};
  }
  if (!host.starts_with('[') || !host.ends_with(']')) refuse_page_address(text);
  host = host.substr(1, host.size() - 2);
  in6_addr ipv6{};
  if (inet_pton(AF_INET6, host.c_str(), &ipv6) != 1) refuse_page_address(text);
  return {.host = host, .port = port, .is_loopback = IN6_IS_ADDR_LOOPBACK(&ipv6) != 0};
}

std::string url_of(const PageAddress& address) {
  const bool is_ipv6 = address.host.find(':') != std::string::npos;
  return is_ipv6 ? fmt::format("http://[{}]:{}/", address.host, address.port)
                 : fmt::format("http://{}:{}/", address.host, address.port);
}

}  // namespace proofmass::coordinator
