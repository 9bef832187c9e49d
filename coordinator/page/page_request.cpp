#include "coordinator/page/page_request.hpp"

#include <fmt/format.h>

#include <charconv>
#include <system_error>

namespace proofmass::coordinator {
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
  path.remove_prefix(1);
  while (!path.empty()) {
    const std::size_t end = path.find('/');
    const std::optional<std::string> part = percent_decoded(path.substr(0, end));
    if (!part || !is_harmless_part(*part)) return false;
    request.path.push_back(*part);
    // A slash at the end begins another part, which is empty.
    if (end != std::string_view::npos && end + 1 == path.size()) return false;
    path = end == std::string_view::npos ? std::string_view() : path.substr(end + 1);
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
  for (std::size_t count = 0; !query.empty(); ++count) {
    if (count == num_parameters_max) return false;
    const std::size_t end = query.find('&');
    const std::string_view item = query.substr(0, end);
    query = end == std::string_view::npos ? std::string_view() : query.substr(end + 1);
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
