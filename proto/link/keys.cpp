#include "proto/link/keys.hpp"

#include <fmt/format.h>
#include <sys/stat.h>
#include <zmq.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <vector>

#include "core/error.hpp"
#include "proto/link/whole_file.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::wire {
namespace {

constexpr std::size_t key_length = 40;
constexpr std::size_t key_file_size_max = 4096;
constexpr std::string_view magic = "proofmass-key";
constexpr std::string_view format_version = "1";

enum class Half : std::uint8_t { secret, public_alone };

std::string_view to_text(Half half) { return half == Half::secret ? "secret" : "public"; }

[[noreturn]] void refuse(const std::filesystem::path& file, std::string_view rule) {
  throw Error(fmt::format("key file = {} ({})", file.string(), rule));
}

bool is_key(std::string_view text) {
  if (text.size() != key_length || text.find('\0') != std::string_view::npos) return false;
  std::array<std::uint8_t, key_length * 4 / 5> bytes{};
  return zmq_z85_decode(bytes.data(), std::string(text).c_str()) != nullptr;
}

std::string header_line(KeyRole role, Half half) {
  return fmt::format("{} {} {} {}", magic, format_version, to_text(role), to_text(half));
}

std::string read_text(const std::filesystem::path& file, Half half) {
  std::string text = read_within_reach(
      "key file", file, half == Half::secret ? Reach::private_to_owner : Reach::written_by_owner,
      key_file_size_max);
  std::erase(text, '\r');
  return std::string(without_byte_order_mark(text));
}

std::vector<std::string_view> split(std::string_view text, char separator) {
  std::vector<std::string_view> parts;
  while (!text.empty()) {
    const std::size_t end = text.find(separator);
    parts.push_back(text.substr(0, end));
    text = end == std::string_view::npos ? std::string_view() : text.substr(end + 1);
  }
  return parts;
}

/// What stands in the file may be a secret, so no message repeats any of it but known words.
void check_header(const std::filesystem::path& file, std::string_view line, KeyRole role,
                  Half half) {
  if (line == header_line(role, half)) return;
  const std::vector<std::string_view> words = split(line, ' ');
  if (words.empty() || words.front() != magic) refuse(file, "is not a key file of Proofmass");
  for (const KeyRole other : {KeyRole::coordinator, KeyRole::worker, KeyRole::client}) {
    for (const Half other_half : {Half::secret, Half::public_alone}) {
      if (line != header_line(other, other_half)) continue;
      refuse(file, fmt::format("is the {} key of a {}; must be the {} key of a {}",
                               to_text(other_half), to_text(other), to_text(half), to_text(role)));
    }
  }
  refuse(file, fmt::format("is of an unknown kind; must begin with `{}`", header_line(role, half)));
}

/// The text after `NAME ` in a line; empty if the line says something else.
std::string_view value_of(std::string_view name, std::string_view line) {
  if (!line.starts_with(name) || line.size() <= name.size()) return {};
  return line[name.size()] == ' ' ? line.substr(name.size() + 1) : std::string_view();
}

std::vector<std::string_view> checked_lines(const std::filesystem::path& file,
                                            std::string_view text, KeyRole role, Half half) {
  const std::vector<std::string_view> lines = split(text, '\n');
  check_header(file, lines.empty() ? std::string_view() : lines.front(), role, half);
  if (lines.size() != (half == Half::secret ? 3U : 2U)) refuse(file, "is damaged");
  return lines;
}

bool belong_together(const PublicKey& public_key, const SecretKey& secret_key) {
  std::array<char, key_length + 1> derived{};
  return zmq_curve_public(derived.data(), secret_key.reveal().c_str()) == 0 &&
         public_key.text() == derived.data();
}

std::filesystem::path key_file(const std::filesystem::path& directory, KeyRole role,
                               std::string_view ending) {
  return directory / fmt::format("{}.{}", to_text(role), ending);
}

}  // namespace

std::string_view to_text(KeyRole role) {
  constexpr std::array<std::string_view, 3> names{"coordinator", "worker", "client"};
  return names.at(static_cast<std::size_t>(role));
}

std::optional<PublicKey> PublicKey::parse(std::string_view text) {
  if (!is_key(text)) return std::nullopt;
  return PublicKey(text);
}

std::optional<SecretKey> SecretKey::parse(std::string_view text) {
  if (!is_key(text)) return std::nullopt;
  return SecretKey(text);
}

KeyPair make_key_pair() {
  std::array<char, key_length + 1> public_text{};
  std::array<char, key_length + 1> secret_text{};
  if (zmq_curve_keypair(public_text.data(), secret_text.data()) != 0) {
    throw Error(fmt::format("key pair: {}", zmq_strerror(zmq_errno())));
  }
  const auto public_key = PublicKey::parse(public_text.data());
  const auto secret_key = SecretKey::parse(secret_text.data());
  PROOFMASS_EXPECT(public_key && secret_key);
  return {.public_key = *public_key, .secret_key = *secret_key};
}

void write_key_pair(const std::filesystem::path& directory, std::string_view name, KeyRole role,
                    const KeyPair& pair) {
  const std::filesystem::path secret_file = directory / fmt::format("{}.key", name);
  const std::filesystem::path public_file = directory / fmt::format("{}.pub", name);
  const std::string public_line = fmt::format("public {}\n", pair.public_key.text());
  // A half that is there alone belongs to another pair.
  for (const auto& file : {secret_file, public_file}) {
    if (std::filesystem::exists(std::filesystem::symlink_status(file))) refuse(file, "File exists");
  }
  write_whole_file("key file", secret_file,
                   fmt::format("{}\n{}secret {}\n", header_line(role, Half::secret), public_line,
                               pair.secret_key.reveal()),
                   private_mode, IfThere::keep);
  write_whole_file("key file", public_file,
                   fmt::format("{}\n{}", header_line(role, Half::public_alone), public_line),
                   trusted_mode, IfThere::keep);
}

KeyPair read_key_pair(const std::filesystem::path& file, KeyRole role) {
  const std::string text = read_text(file, Half::secret);
  const auto lines = checked_lines(file, text, role, Half::secret);
  const auto public_key = PublicKey::parse(value_of("public", lines[1]));
  const auto secret_key = SecretKey::parse(value_of("secret", lines[2]));
  if (!public_key || !secret_key) refuse(file, "is damaged");
  if (!belong_together(*public_key, *secret_key)) {
    refuse(file, "is damaged: its halves do not belong together");
  }
  return {.public_key = *public_key, .secret_key = *secret_key};
}

PublicKey read_public_key(const std::filesystem::path& file, KeyRole role) {
  const std::string text = read_text(file, Half::public_alone);
  const auto lines = checked_lines(file, text, role, Half::public_alone);
  const auto public_key = PublicKey::parse(value_of("public", lines[1]));
  if (!public_key) refuse(file, "is damaged");
  return *public_key;
}

std::string domain_of(KeyRole role) { return fmt::format("{}s", to_text(role)); }

std::string list_name(KeyRole role) { return "authorized_" + domain_of(role); }

Protection protection_by(const std::optional<std::filesystem::path>& keys, bool is_plain_waived) {
  if (keys) return Protection::keys;
  return is_plain_waived ? Protection::waived : Protection::none;
}

void check_key_directory(const std::filesystem::path& directory) {
  struct stat status {};
  if (::stat(directory.c_str(), &status) != 0) {
    throw Error(fmt::format("key directory = {} ({})", directory.string(), std::strerror(errno)));
  }
  check_reach("key directory", directory, status, Reach::written_by_owner);
}

ServerSecurity read_server_security(const std::filesystem::path& directory, KeyRole peers) {
  check_key_directory(directory);
  const std::filesystem::path file = key_file(directory, KeyRole::coordinator, "key");
  return {.peers = peers, .keys = read_key_pair(file, KeyRole::coordinator)};
}

ClientSecurity read_client_security(const std::filesystem::path& directory, KeyRole role) {
  check_key_directory(directory);
  const std::filesystem::path trusted = key_file(directory, KeyRole::coordinator, "pub");
  return {.identity = CurveIdentity{.role = role,
                                    .keys = read_key_pair(key_file(directory, role, "key"), role),
                                    .coordinator = read_public_key(trusted, KeyRole::coordinator)}};
}

}  // namespace proofmass::wire
