#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>

#include "proto/link/keys.hpp"
#include "proto/text/event.hpp"

namespace proofmass::coordinator {

enum class Right : std::uint8_t {
  observe,  ///< See campaigns, workers and factories; report how a factory stands.
  submit,   ///< Submit campaigns, and control those that the same name submitted.
  control,  ///< Control the campaigns of everybody; release hosts.
};

using Rights = std::set<Right>;
inline const Rights all_rights{Right::observe, Right::submit, Right::control};
/// The rights of a client whose line in the list names none.
inline const Rights usual_rights{Right::observe, Right::submit};
/// The rights that a comma list grants, such as `observe,submit`; nothing if it is not such a list.
[[nodiscard]] std::optional<Rights> parse_rights(std::string_view text);

/// The owner of a key, as one that asks for something.
struct Asker {
  std::string name;            ///< Of its key, as in the list; empty without keys.
  Rights rights = all_rights;  ///< Of a client; a worker has none.

  bool operator==(const Asker&) const = default;
};

/// @throws Error reading `key = NAME (must have the right ...)` if the asker does not have it.
void require_right(const Asker& asker, Right right);

/// Checks that the asker may control a campaign: with the right `control` any, with `submit` its
/// own and those without an owner.
///
/// @param owner  Name of the key that submitted it; empty if not known.
/// @throws Error reading `campaign = NAME (rule)` or as require_right() does.
void require_control(const Asker& asker, std::string_view campaign, std::string_view owner);

/// What one key may have submitted and not finished.
struct SubmissionLimits {
  std::size_t campaigns_max = 100;
  std::uint64_t size_max = std::uint64_t{1} << 30;  ///< Of their definitions, bytes.
};

inline constexpr std::size_t allowed_keys_max = 65536;

/// Owners by public key.
using AllowedKeys = std::map<std::string, Asker, std::less<>>;

/// The keys in the text of an allow-list. Each has a line `KEY NAME`, or `KEY NAME RIGHTS` for a
/// client. Empty lines and lines that begin with `#` are ignored.
///
/// @param role  Whose list it is.
/// @param file  For messages.
/// @throws Error reading `FILE line = NUMBER (rule)`. What the line says is not repeated, because
///         somebody may have put a secret there.
[[nodiscard]] AllowedKeys parse_allow_list(std::string_view text, wire::KeyRole role,
                                           const std::filesystem::path& file);

/// The keys that may connect to one address of the coordinator, from a file that may change at any
/// time. A key whose line is removed is revoked when two looks, a second or more apart, agree that
/// it is gone: an editor or a full disk may leave a part of the file for a moment.
class AllowList {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;

  /// @param log  Told if keys, or what they may do, changed, or if the file can be read after it
  ///             could not; and what is wrong with it, once.
  /// @throws Error if the file cannot be read, can be written by others than its owner, or holds
  ///         anything but keys and names.
  AllowList(std::filesystem::path file, wire::KeyRole role, wire::Log log);

  /// Reads the file again if it changed. A file that is wrong, gone or without any content leaves
  /// the list as it was.
  void refresh(TimePoint now);

  /// As refresh(), but at most once a second.
  void refresh_if_due(TimePoint now);

  /// The key's owner; null if the key is not on the list.
  [[nodiscard]] const Asker* owner_of(std::string_view public_key) const;

 private:
  /// What tells one state of the file from another.
  struct Stamp {
    std::int64_t changed_ns = 0;
    std::int64_t size = 0;
    std::uint64_t inode = 0;
    int error = 0;  ///< errno if there is no file.

    bool operator==(const Stamp&) const = default;
  };
  [[nodiscard]] static Stamp stamp_of(const std::filesystem::path& file);
  [[nodiscard]] static bool is_settled(const Stamp& stamp);
  void take(AllowedKeys keys, TimePoint now);

  std::filesystem::path file_;
  wire::KeyRole role_;
  wire::Log log_;
  std::optional<Stamp> stamp_;  ///< None if the file must be read again in any case.
  std::string reported_;
  std::optional<TimePoint> looked_at_;
  AllowedKeys keys_;
  /// Without the keys that the last look did not find any more, and the time of that look.
  std::optional<std::pair<AllowedKeys, TimePoint>> shorter_;
};

}  // namespace proofmass::coordinator
