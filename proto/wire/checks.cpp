#include "proto/wire/checks.hpp"

#include <fmt/format.h>
#include <google/protobuf/stubs/logging.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "core/error.hpp"
#include "proto/wire/names.hpp"

namespace proofmass::wire::detail {

void require(bool condition, std::string_view field, const std::string& value,
             std::string_view rule) {
  if (!condition) throw ConfigError(field, value, rule);
}

void require_in(std::uint64_t value, std::uint64_t minimum, std::uint64_t maximum,
                std::string_view field) {
  // Texts are made for a refusal only: a batch of results calls this thousands of times.
  if (value >= minimum && value <= maximum) return;
  throw ConfigError(field, fmt::format("{}", value),
                    fmt::format("must be in [{}, {}]", minimum, maximum));
}

void require_count(int count, std::uint64_t minimum, std::uint64_t maximum,
                   std::string_view field) {
  const auto size = static_cast<std::uint64_t>(count);
  if (size >= minimum && size <= maximum) return;
  throw ConfigError(field, fmt::format("{} entries", count),
                    fmt::format("must be in [{}, {}]", minimum, maximum));
}

std::string checked_name(const std::string& name, std::string_view field) {
  // The name itself is not repeated: it may hold anything.
  require(is_name(name), field, fmt::format("{} bytes", name.size()),
          "must be 1 to 128 of [A-Za-z0-9._-]");
  return name;
}

double checked_magnitude(double value, std::string_view field) {
  if (std::isfinite(value) && value >= 0.0) return value;
  throw ConfigError(field, fmt::format("{}", value), "must be >= 0");
}

std::uint64_t checked_id(std::uint64_t id, std::string_view field) {
  require(id != 0, field, "0", "must not be 0");
  return id;
}

std::string printable(std::string_view text) {
  constexpr std::size_t length_max = 400;
  std::string result(text.substr(0, length_max));
  std::replace_if(
      result.begin(), result.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
  return result;
}

void silence_protobuf() {
  static const auto former = google::protobuf::SetLogHandler(nullptr);
  (void)former;
}

}  // namespace proofmass::wire::detail
