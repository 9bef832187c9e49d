#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace proofmass::coordinator {

/// What a client may do.
enum class Right : std::uint8_t {
  observe = 1,  ///< See campaigns, workers and factories; report how a factory stands.
  submit = 2,   ///< Submit campaigns, and control those that the same name submitted.
  control = 4,  ///< Control the campaigns of everybody; release hosts.
};

/// A set of rights.
class Rights {
 public:
  constexpr Rights() = default;

  /// The rights that a comma list grants, such as `observe,submit`; nothing if it is not such a
  /// list.
  [[nodiscard]] static std::optional<Rights> parse(std::string_view text);
  [[nodiscard]] static constexpr Rights all() { return Rights(7); }
  /// The rights of a client whose line in the list names none: observe and submit.
  [[nodiscard]] static constexpr Rights usual() { return Rights(3); }

  [[nodiscard]] constexpr bool has(Right right) const {
    return (bits_ & static_cast<std::uint8_t>(right)) != 0;
  }

  bool operator==(const Rights&) const = default;

 private:
  explicit constexpr Rights(std::uint8_t bits) : bits_(bits) {}

  std::uint8_t bits_ = 0;
};

/// The client that asks for something.
struct Asker {
  std::string name;  ///< Of its key, as in the list; empty without keys.
  Rights rights = Rights::all();
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

}  // namespace proofmass::coordinator
