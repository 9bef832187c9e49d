#include "proto/link/security.hpp"

#include <fmt/format.h>

namespace proofmass::wire {
namespace {

std::filesystem::path key_file(const std::filesystem::path& directory, KeyRole role,
                               std::string_view ending) {
  return directory / fmt::format("{}.{}", to_text(role), ending);
}

}  // namespace

std::string_view to_text(Domain domain) {
  return domain == Domain::workers ? "workers" : "clients";
}

ServerSecurity read_server_security(const std::filesystem::path& directory, Domain domain) {
  const std::filesystem::path file = key_file(directory, KeyRole::coordinator, "key");
  return {.domain = domain, .keys = read_key_pair(file, KeyRole::coordinator)};
}

ClientSecurity read_client_security(const std::filesystem::path& directory, KeyRole role) {
  const std::filesystem::path trusted = key_file(directory, KeyRole::coordinator, "pub");
  return {.identity = CurveIdentity{.role = role,
                                    .keys = read_key_pair(key_file(directory, role, "key"), role),
                                    .coordinator = read_public_key(trusted, KeyRole::coordinator)}};
}

}  // namespace proofmass::wire
