#include "coordinator/net/authentication/rights.hpp"

#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <utility>

#include "core/error.hpp"
#include "proto/link/keys.hpp"
#include "proto/link/whole_file.hpp"
#include "proto/text/visible_text.hpp"
#include "proto/wire/names.hpp"

namespace proofmass::coordinator {
namespace {

using NamedRight = std::pair<std::string_view, Right>;
constexpr std::array<NamedRight, 3> names{
    {{"observe", Right::observe}, {"submit", Right::submit}, {"control", Right::control}}};

std::string_view name_of(Right right) {
  return std::ranges::find(names, right, &NamedRight::second)->first;
}

constexpr std::size_t file_size_max = std::size_t{16} << 20;
constexpr std::chrono::seconds look_interval(1);
/// The clock of a file system is coarse: a file may change twice with the same time.
constexpr std::chrono::nanoseconds settled_after = std::chrono::milliseconds(100);

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

std::string_view take_word(std::string_view& line) {
  const auto begin = std::ranges::find_if_not(line, is_blank);
  const auto end = std::find_if(begin, line.end(), is_blank);
  const std::string_view word(begin, end);
  line = std::string_view(end, line.end());
  return word;
}

/// Adds what one line says.
/// @return Which rule it breaks; empty if none.
std::string_view read_line(std::string_view line, wire::KeyRole role, AllowedKeys& keys) {
  const std::string_view key = take_word(line);
  if (key.empty() || key.front() == '#') return {};
  const std::string_view name = take_word(line);
  if (!wire::PublicKey::parse(key)) return "must begin with a public key of 40 characters";
  if (!wire::is_name(name))
    return "must have a name of [A-Za-z0-9._-], a letter or digit first, after the key";
  const std::string_view rights_text = take_word(line);
  std::optional<Rights> rights;
  if (role == wire::KeyRole::client) {
    rights = rights_text.empty() ? usual_rights : parse_rights(rights_text);
    if (!rights) return "must have rights of observe,submit,control after the name";
  } else if (!rights_text.empty()) {
    return "must be KEY NAME";
  }
  if (!take_word(line).empty()) return "must be KEY NAME RIGHTS";
  const Asker owner{.name = std::string(name), .rights = rights.value_or(Rights())};
  if (!keys.emplace(key, owner).second) return "names a key a second time";
  if (keys.size() > allowed_keys_max) return "is one key too many";
  return {};
}

AllowedKeys read_allow_list(const std::filesystem::path& file, wire::KeyRole role) {
  const std::string text =
      wire::read_within_reach("allow-list", file, wire::Reach::written_by_owner, file_size_max);
  return parse_allow_list(text, role, file);
}

std::size_t num_only_in(const AllowedKeys& keys, const AllowedKeys& others) {
  return static_cast<std::size_t>(std::ranges::count_if(keys, [&](const auto& item) {
    const auto found = others.find(item.first);
    return found == others.end() || found->second != item.second;
  }));
}

}  // namespace

std::optional<Rights> parse_rights(std::string_view text) {
  Rights rights;
  for (;;) {
    const std::size_t end = std::min(text.find(','), text.size());
    const auto found = std::ranges::find(names, text.substr(0, end), &NamedRight::first);
    if (found == names.end()) return std::nullopt;
    rights.insert(found->second);
    if (end == text.size()) return rights;
    text.remove_prefix(end + 1);
  }
}

void require_right(const Asker& asker, Right right) {
  if (asker.rights.contains(right)) return;
  throw Error(
      fmt::format("key = {} (must have the right `{}` in authorized_clients of the coordinator)",
                  asker.name, name_of(right)));
}

void require_control(const Asker& asker, std::string_view campaign, std::string_view owner) {
  if (asker.rights.contains(Right::control)) return;
  if (owner.empty() || owner == asker.name) return require_right(asker, Right::submit);
  throw Error(fmt::format("campaign = {} (belongs to {}; the key {} must have the right `control`)",
                          campaign, owner, asker.name));
}

AllowedKeys parse_allow_list(std::string_view text, wire::KeyRole role,
                             const std::filesystem::path& file) {
  AllowedKeys keys;
  text = wire::without_byte_order_mark(text);
  for (std::size_t number = 1; !text.empty(); ++number) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::string_view rule = read_line(text.substr(0, end), role, keys);
    if (!rule.empty()) {
      throw Error(fmt::format("{} line = {} ({})", file.string(), number, rule));
    }
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return keys;
}

AllowList::AllowList(std::filesystem::path file, wire::KeyRole role, wire::Log log)
    : file_(std::move(file)), role_(role), log_(std::move(log)) {
  const Stamp stamp = stamp_of(file_);
  keys_ = read_allow_list(file_, role_);
  if (is_settled(stamp)) stamp_ = stamp;
}

/// New keys count at once.
void AllowList::take(AllowedKeys keys, TimePoint now) {
  const bool is_confirmed = shorter_ && shorter_->first == keys;
  if (!is_confirmed) shorter_.emplace(keys, now);
  AllowedKeys with_former = keys;
  with_former.insert(keys_.begin(), keys_.end());
  const bool revokes = with_former.size() > keys.size();
  const bool is_due = is_confirmed && now - shorter_->second >= look_interval;
  keys_ = !revokes || is_due ? std::move(keys) : std::move(with_former);
  if (!revokes || is_due) return shorter_.reset();
  stamp_.reset();  // Looked at again, though it may not change.
}

void AllowList::refresh(TimePoint now) {
  // Taken before the file is read: a change in between is seen the next time.
  const Stamp stamp = stamp_of(file_);
  if (stamp == stamp_) return;
  stamp_ = is_settled(stamp) ? std::optional(stamp) : std::nullopt;
  try {
    if (stamp.error == 0 && stamp.size == 0) {
      throw Error(fmt::format("allow-list = {} (is empty)", file_.string()));
    }
    const AllowedKeys former = keys_;
    take(read_allow_list(file_, role_), now);
    const bool was_unreadable = !std::exchange(reported_, {}).empty();
    if (keys_ == former && !was_unreadable) return;
    log_(wire::Event::info("allow_list_read", {{"file", file_.string()},
                                               {"added", num_only_in(keys_, former)},
                                               {"removed", num_only_in(former, keys_)}}));
  } catch (const Error& error) {
    if (std::exchange(reported_, error.what()) == error.what()) return;
    log_(wire::Event::error("allow_list_unreadable",
                            {wire::Field::remark(reported_ + "; the list before it stands")}));
  }
}

void AllowList::refresh_if_due(TimePoint now) {
  if (looked_at_ && now - *looked_at_ < look_interval) return;
  looked_at_ = now;
  refresh(now);
}

const Asker* AllowList::owner_of(std::string_view public_key) const {
  const auto found = keys_.find(public_key);
  return found == keys_.end() ? nullptr : &found->second;
}

AllowList::Stamp AllowList::stamp_of(const std::filesystem::path& file) {
  struct stat status {};
  if (::stat(file.c_str(), &status) != 0) return {.error = errno};
  constexpr std::int64_t ns_per_s = 1'000'000'000;
  return {.changed_ns = status.st_ctim.tv_sec * ns_per_s + status.st_ctim.tv_nsec,
          .size = status.st_size,
          .inode = status.st_ino};
}

bool AllowList::is_settled(const Stamp& stamp) {
  if (stamp.error != 0) return true;
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return now - std::chrono::nanoseconds(stamp.changed_ns) > settled_after;
}

}  // namespace proofmass::coordinator
