#include "coordinator/store/detail/file_system.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/statfs.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <string>

#include "coordinator/store/store_error.hpp"

namespace proofmass::coordinator::detail {
namespace {

struct FileSystemType {
  std::uint64_t type;  // Magic number as in linux/magic.h, or of the file system's own sources.
  std::string_view name;
};

constexpr std::array<FileSystemType, 12> network_file_systems{{
    {0x6969, "NFS"},
    {0x517B, "SMB"},
    {0xFE534D42, "SMB2"},
    {0xFF534D42, "CIFS"},
    {0x01021997, "9P"},
    {0x5346414F, "AFS"},
    {0x73757245, "Coda"},
    {0x00C36400, "Ceph"},
    {0x0BD00BD0, "Lustre"},
    {0x47504653, "GPFS"},
    {0x19830326, "BeeGFS"},
    {0xAAD7AAEA, "PanFS"},
}};

std::filesystem::path directory_of(const std::filesystem::path& path) {
  return std::filesystem::absolute(path).parent_path();
}

}  // namespace

std::string_view network_file_system_name(std::uint64_t type) {
  const auto* found = std::find_if(network_file_systems.begin(), network_file_systems.end(),
                                   [&](const FileSystemType& entry) { return entry.type == type; });
  return found == network_file_systems.end() ? std::string_view() : found->name;
}

void check_directory_of(const std::filesystem::path& path) {
  const std::string directory = directory_of(path).string();
  struct statfs status {};
  if (statfs(directory.c_str(), &status) != 0) {
    throw StoreError(fmt::format("directory = {} ({})", directory, std::strerror(errno)));
  }
  // The kernel's types have 32 bits; f_type is signed and may have extended the uppermost.
  const auto type = static_cast<std::uint32_t>(status.f_type);
  const std::string_view name = network_file_system_name(type);
  if (!name.empty()) {
    throw StoreError(
        fmt::format("directory = {} (is on the network file system {}, where a campaign "
                    "file may be damaged; use a local disk)",
                    directory, name));
  }
}

void synchronise_directory_of(const std::filesystem::path& path) {
  const std::string directory = directory_of(path).string();
  const int descriptor = ::open(directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  const bool is_done = descriptor >= 0 && ::fsync(descriptor) == 0;
  const int error = errno;
  if (descriptor >= 0) ::close(descriptor);
  if (!is_done) {
    throw StoreError(fmt::format("directory = {} ({})", directory, std::strerror(error)));
  }
}

}  // namespace proofmass::coordinator::detail
