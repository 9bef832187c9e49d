#include "coordinator/page/page_access.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <sodium.h>
#include <strings.h>

#include <algorithm>
#include <charconv>
#include <ranges>
#include <system_error>

#include "core/error.hpp"
#include "proto/link/whole_file.hpp"

namespace proofmass::coordinator {
namespace {

/// Of IPv4: 127.0.0.0/8; empty if it is no address.
std::optional<bool> is_loopback_ipv4(const std::string& address) {
  constexpr std::uint32_t loopback_network = 127;
  in_addr ipv4{};
  if (inet_pton(AF_INET, address.c_str(), &ipv4) != 1) return std::nullopt;
  return ntohl(ipv4.s_addr) >> 24 == loopback_network;
}

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

constexpr std::size_t token_size_min = 16;
constexpr std::size_t token_size_max = 256;
constexpr std::string_view cookie_purpose = "proofmass page cookie";

using TokenDigest = std::array<unsigned char, 32>;

TokenDigest digest_of(std::string_view text, std::string_view purpose) {
  TokenDigest digest{};
  crypto_generichash(digest.data(), digest.size(),
                     reinterpret_cast<const unsigned char*>(text.data()), text.size(),
                     reinterpret_cast<const unsigned char*>(purpose.data()), purpose.size());
  return digest;
}

/// The parts between separators; none of an empty text.
std::vector<std::string_view> parts_of(std::string_view text, char separator) {
  std::vector<std::string_view> parts;
  for (const auto part : text | std::views::split(separator)) {
    parts.emplace_back(part.begin(), part.end());
  }
  return parts;
}

/// The token in `Bearer TOKEN`. Letters of the scheme have no case, and several blanks may follow
/// it: RFC 7235, section 2.1.
std::string_view bearer_in(std::string_view header) {
  constexpr std::string_view scheme = "Bearer ";
  const bool is_bearer = header.size() >= scheme.size() &&
                         strncasecmp(header.data(), scheme.data(), scheme.size()) == 0;
  if (!is_bearer) return {};
  header.remove_prefix(scheme.size());
  return header.substr(std::min(header.find_first_not_of(' '), header.size()));
}

/// `./` at the front page and beside it, `./../` one level below: also behind a proxy that serves
/// the page below an address of its own.
std::string way_to_front_page(std::string_view target) {
  std::string way = "./";
  for (auto i = std::ranges::count(target.substr(0, target.find('?')), '/'); i > 1; --i) {
    way += "../";
  }
  return way;
}

}  // namespace

PageAddress parse_page_address(std::string_view text) {
  const std::size_t colon = text.rfind(':');
  if (colon == std::string_view::npos) refuse_page_address(text);
  std::string host(text.substr(0, colon));
  const std::uint16_t port = port_in(text.substr(colon + 1), text);
  if (host == "localhost") host = "127.0.0.1";
  if (host == "*") host = "0.0.0.0";
  if (const std::optional<bool> is_loopback = is_loopback_ipv4(host)) {
    return {.host = host, .port = port, .is_loopback = *is_loopback};
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

PageAccess PageAccess::read(const std::filesystem::path& token_file) {
  constexpr std::string_view what = "page token file";
  constexpr std::size_t file_size_max = 4096;  // Of one that is worth saying what a token is.
  std::string text =
      wire::read_within_reach(what, token_file, wire::Reach::private_to_owner, file_size_max);
  if (text.ends_with('\n')) text.pop_back();
  const bool is_visible = std::ranges::all_of(text, [](char c) { return c > ' ' && c <= '~'; });
  if (is_visible && text.size() >= token_size_min && text.size() <= token_size_max) {
    return PageAccess(text);
  }
  throw Error(fmt::format("{} = {} (must hold {} to {} visible ASCII characters and nothing else)",
                          what, token_file.string(), token_size_min, token_size_max));
}

// A browser keeps one cookie of a name for all ports of a host: each token has its own.
PageAccess::PageAccess(std::string_view token) : digest_(digest_of(token, "")) {
  const std::string value = fmt::format("{:02x}", fmt::join(digest_of(token, cookie_purpose), ""));
  constexpr std::size_t num_name_digits = 8;
  cookie_ = fmt::format("proofmass_page_{}={}", value.substr(0, num_name_digits),
                        value.substr(num_name_digits));
}

bool PageAccess::is_token(std::string_view text) const {
  const TokenDigest other = digest_of(text, "");
  return has_token() && sodium_memcmp(digest_.data(), other.data(), digest_.size()) == 0;
}

bool PageAccess::has_cookie(std::string_view header) const {
  return std::ranges::any_of(parts_of(header, ';'), [this](std::string_view part) {
    part.remove_prefix(std::min(part.find_first_not_of(' '), part.size()));
    return part.size() == cookie_.size() &&
           sodium_memcmp(part.data(), cookie_.data(), part.size()) == 0;
  });
}

std::optional<HttpAnswer> PageAccess::refusal_of(const HttpRequest& request) const {
  if (!has_token()) {
    if (is_loopback_host(request.host)) return std::nullopt;
    return plain_answer(403,
                        "Host: must be localhost or a loopback address, unless the coordinator "
                        "has a --page-token-file");
  }
  if (is_token(bearer_in(request.authorization))) return std::nullopt;
  if (has_cookie(request.cookie)) return std::nullopt;
  // Of one who comes by a link from elsewhere the browser holds the cookie back, but not if the
  // same address is opened from here.
  return HttpAnswer{
      .status = 401,
      .body = fmt::format(
          "<!DOCTYPE html><html lang=\"en\"><head><title>Proofmass</title></head><body><main>"
          "<h1>A token is needed</h1><p>Open the <a href=\"{}\">front page</a> once with "
          "<code>?token=</code> and the content of the page token file at the end of its address. "
          "If you have done so and came here by a link, <a href=\"\">open this page again</a>.</p>"
          "</main></body></html>\n",
          way_to_front_page(request.target)),
      .headers = {{"WWW-Authenticate", "Bearer"}}};
}

// The cookie has no path: the browser takes that of the page, also behind a proxy.
std::optional<HttpAnswer> PageAccess::welcome(std::string_view given_token) const {
  if (!is_token(given_token)) return std::nullopt;
  HttpAnswer answer = plain_answer(303, "the token is right");
  answer.headers = {{"Location", "./"}, {"Set-Cookie", cookie_ + "; HttpOnly; SameSite=Strict"}};
  return answer;
}

bool is_loopback_host(std::string_view host) {
  if (host.starts_with('[')) return host == "[::1]" || host.starts_with("[::1]:");
  const std::string name(host.substr(0, host.find(':')));
  if (strcasecmp(name.c_str(), "localhost") == 0) return true;
  return is_loopback_ipv4(name).value_or(false);
}

namespace {

constexpr std::size_t num_parameters_max = 16;

/// Nothing if a % is not followed by two hexadecimal digits.
std::optional<std::string> percent_decoded(std::string_view text) {
  std::string decoded;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '%') {
      decoded += text[i];
      continue;
    }
    const std::string_view digits = text.substr(i + 1, 2);
    unsigned char byte = 0;
    const auto [end, error] =
        std::from_chars(digits.data(), digits.data() + digits.size(), byte, 16);
    if (digits.size() != 2 || error != std::errc() || end != digits.data() + 2) return {};
    decoded += static_cast<char>(byte);
    i += 2;
  }
  return decoded;
}

bool is_harmless_part(const std::string& part) {
  return !part.empty() && part != "." && part != ".." && part.find('/') == std::string::npos &&
         part.find('\0') == std::string::npos;
}

bool add_path(std::string_view path, PageRequest& request) {
  if (!path.starts_with('/')) return false;
  for (const std::string_view text : parts_of(path.substr(1), '/')) {
    const std::optional<std::string> part = percent_decoded(text);
    if (!part || !is_harmless_part(*part)) return false;
    request.path.push_back(*part);
  }
  return true;
}

/// Forms write a blank as a plus.
std::optional<std::string> decoded_value(std::string_view text) {
  std::string with_blanks(text);
  for (char& c : with_blanks) {
    if (c == '+') c = ' ';
  }
  return percent_decoded(with_blanks);
}

bool add_parameters(std::string_view query, PageRequest& request) {
  const std::vector<std::string_view> items = parts_of(query, '&');
  if (items.size() > num_parameters_max) return false;
  for (const std::string_view item : items) {
    const std::size_t sign = item.find('=');
    const auto name = decoded_value(item.substr(0, sign));
    const auto value = decoded_value(sign == std::string_view::npos ? "" : item.substr(sign + 1));
    if (!name || !value) return false;
    request.parameters.insert_or_assign(*name, *value);
  }
  return true;
}

}  // namespace

std::string PageRequest::text(const std::string& parameter) const {
  const auto found = parameters.find(parameter);
  return found == parameters.end() ? std::string() : found->second;
}

std::optional<std::uint64_t> PageRequest::number(const std::string& parameter) const {
  const std::string digits = text(parameter);
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (digits.empty() || error != std::errc() || end != digits.data() + digits.size()) return {};
  return value;
}

std::optional<PageRequest> parse_target(std::string_view target) {
  PageRequest request;
  const std::size_t mark = target.find('?');
  if (!add_path(target.substr(0, mark), request)) return std::nullopt;
  const std::string_view query =
      mark == std::string_view::npos ? std::string_view() : target.substr(mark + 1);
  if (!add_parameters(query, request)) return std::nullopt;
  return request;
}

std::string percent_encoded(std::string_view text) {
  constexpr std::string_view plain =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-._~";
  std::string encoded;
  for (const char c : text) {
    if (plain.find(c) != std::string_view::npos) {
      encoded += c;
    } else {
      encoded += fmt::format("%{:02X}", static_cast<unsigned char>(c));
    }
  }
  return encoded;
}

}  // namespace proofmass::coordinator
