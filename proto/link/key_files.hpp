#pragma once

#include <compare>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

namespace proofmass::wire {

/// Whom a pair of keys stands for.
enum class KeyRole : std::uint8_t { coordinator, worker, client };

[[nodiscard]] std::string_view to_text(KeyRole role);  ///< `coordinator`, `worker`, `client`.

/// The public half of a pair, which anybody may know: Curve25519 in ZeroMQ's Z85 form, 40 printable
/// characters. The first is never `#`, as that would be more than 32 bits: a list of keys can have
/// comments.
class PublicKey {
 public:
  /// Nothing if the text is not such a key.
  [[nodiscard]] static std::optional<PublicKey> parse(std::string_view text);

  [[nodiscard]] const std::string& text() const { return text_; }

  auto operator<=>(const PublicKey&) const = default;

 private:
  explicit PublicKey(std::string_view text) : text_(text) {}

  std::string text_;
};

/// The secret half of a pair. It cannot be printed by accident: only reveal() gives its text.
class SecretKey {
 public:
  [[nodiscard]] static std::optional<SecretKey> parse(std::string_view text);

  /// For a socket and for a key file; not for a log, an error or another process.
  [[nodiscard]] const std::string& reveal() const { return text_; }

 private:
  explicit SecretKey(std::string_view text) : text_(text) {}

  std::string text_;
};

struct KeyPair {
  PublicKey public_key;
  SecretKey secret_key;
};

/// A new pair, from the system's random numbers.
[[nodiscard]] KeyPair make_key_pair();

/// Writes a pair to two new files: `NAME.key` with both halves, mode 0600, and `NAME.pub` with the
/// public one, mode 0644. Either file is whole or not there, also after a crash.
///
/// @param directory  Exists.
/// @throws Error reading `key file = PATH (rule)` if one of them exists or cannot be written.
void write_key_pair(const std::filesystem::path& directory, std::string_view name, KeyRole role,
                    const KeyPair& pair);

/// Reads `NAME.key`.
///
/// @param role  Whose key it must be.
/// @throws Error reading `key file = PATH (rule)` if it cannot be read, is somebody else's, can be
///         read by others than its owner, or holds no pair of that role. No message has a secret.
[[nodiscard]] KeyPair read_key_pair(const std::filesystem::path& file, KeyRole role);

/// Reads `NAME.pub`.
/// @throws Error as read_key_pair() does, but for the owner and the mode, which do not matter.
[[nodiscard]] PublicKey read_public_key(const std::filesystem::path& file, KeyRole role);

// What stands in a directory of keys, as `proofmass keygen` makes it.

inline constexpr std::string_view coordinator_key_name = "coordinator";
inline constexpr std::string_view worker_key_name = "worker";
inline constexpr std::string_view client_key_name = "client";
inline constexpr std::string_view authorized_workers_name = "authorized_workers";
inline constexpr std::string_view authorized_clients_name = "authorized_clients";

}  // namespace proofmass::wire
