#include "core/campaign/name.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "core/error.hpp"

namespace proofmass {
namespace {

constexpr std::size_t campaign_name_length_max = 64;

// Independent of the locale, unlike std::isalnum.
bool is_letter_or_digit(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
}

}  // namespace

bool may_be_in_name(char c) { return is_letter_or_digit(c) || c == '.' || c == '_' || c == '-'; }

bool has_name_form(std::string_view text) {
  return !text.empty() && is_letter_or_digit(text.front()) &&
         std::ranges::all_of(text, may_be_in_name);
}

bool is_name(std::string_view text) {
  return text.size() <= name_length_max && has_name_form(text);
}

void check_campaign_name(const std::string& name, NameOrigin origin) {
  const bool has_form = has_name_form(origin == NameOrigin::given ? name : "x" + name);
  if (has_form && !name.empty() && name.size() <= campaign_name_length_max) return;
  throw ConfigError("campaign.name", fmt::format("\"{:.100}\"", name),
                    fmt::format("must be 1 to {} of {}", campaign_name_length_max, name_rule));
}

}  // namespace proofmass
