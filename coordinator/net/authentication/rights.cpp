#include "coordinator/net/authentication/rights.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

#include "core/error.hpp"

namespace proofmass::coordinator {
namespace {

using NamedRight = std::pair<std::string_view, Right>;
constexpr std::array<NamedRight, 3> names{
    {{"observe", Right::observe}, {"submit", Right::submit}, {"control", Right::control}}};

std::string_view name_of(Right right) {
  return std::ranges::find(names, right, &NamedRight::second)->first;
}

}  // namespace

std::optional<Rights> Rights::parse(std::string_view text) {
  std::uint8_t bits = 0;
  for (;;) {
    const std::size_t end = std::min(text.find(','), text.size());
    const auto found = std::ranges::find(names, text.substr(0, end), &NamedRight::first);
    if (found == names.end()) return std::nullopt;
    bits = static_cast<std::uint8_t>(bits | static_cast<std::uint8_t>(found->second));
    if (end == text.size()) return Rights(bits);
    text.remove_prefix(end + 1);
  }
}

void require_right(const Asker& asker, Right right) {
  if (asker.rights.has(right)) return;
  throw Error(
      fmt::format("key = {} (must have the right `{}` in authorized_clients of the coordinator)",
                  asker.name, name_of(right)));
}

void require_control(const Asker& asker, std::string_view campaign, std::string_view owner) {
  if (asker.rights.has(Right::control)) return;
  require_right(asker, Right::submit);
  if (owner.empty() || owner == asker.name) return;
  throw Error(fmt::format("campaign = {} (belongs to {}; the key {} must have the right `control`)",
                          campaign, owner, asker.name));
}

}  // namespace proofmass::coordinator
