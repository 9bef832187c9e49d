#include "proto/wire/names.hpp"

#include <algorithm>
#include <cstddef>

namespace proofmass::wire {
namespace {

constexpr std::size_t name_length_max = 128;

/// Independent of the locale, unlike std::isalnum.
bool may_be_in_name(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' ||
         c == '_' || c == '-';
}

}  // namespace

bool is_name(std::string_view text) {
  return !text.empty() && text.size() <= name_length_max &&
         std::all_of(text.begin(), text.end(), may_be_in_name);
}

std::string name_from(std::string_view text) {
  std::string name(text.substr(0, name_length_max));
  std::replace_if(
      name.begin(), name.end(), [](char c) { return !may_be_in_name(c); }, '-');
  return name.empty() ? "unnamed" : name;
}

}  // namespace proofmass::wire
