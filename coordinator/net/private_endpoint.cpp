#include "coordinator/net/private_endpoint.hpp"

#include <fmt/format.h>
#include <stdlib.h>

#include <cerrno>
#include <cstring>
#include <system_error>

#include "core/error.hpp"

namespace proofmass::coordinator {
namespace {

std::filesystem::path make_directory() {
  // The temporary directory may be deep, but a socket's path has 107 bytes at most.
  std::error_code ignored;
  std::filesystem::path parent = std::filesystem::temp_directory_path(ignored);
  if (ignored || parent.string().size() > 70) parent = "/tmp";
  std::string name = (parent / "proofmass-XXXXXX").string();
  if (mkdtemp(name.data()) == nullptr) {
    throw Error(fmt::format("temporary directory = {} ({})", name, std::strerror(errno)));
  }
  return name;
}

}  // namespace

PrivateEndpoint::PrivateEndpoint() : directory_(make_directory()) {}

PrivateEndpoint::~PrivateEndpoint() {
  std::error_code ignored;
  std::filesystem::remove_all(directory_, ignored);
}

std::string PrivateEndpoint::address() const {
  return "ipc://" + (directory_ / "workers").string();
}

}  // namespace proofmass::coordinator
