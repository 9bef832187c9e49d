#include "coordinator/store/detail/file_system.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <sys/statfs.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <sstream>
#include <string>
#include <system_error>

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

constexpr std::uint64_t fuse_type = 0x65735546;

// Sorted. Others run in user space, too, and are of this machine: ntfs-3g, fuse-overlayfs,
// gocryptfs.
constexpr std::array<std::string_view, 16> network_fuse_types{
    "fuse.blobfuse2", "fuse.ceph",    "fuse.ceph-fuse", "fuse.curlftpfs",
    "fuse.cvmfs2",    "fuse.davfs2",  "fuse.gcsfuse",   "fuse.glusterfs",
    "fuse.goofys",    "fuse.juicefs", "fuse.lizardfs",  "fuse.mfs",
    "fuse.rclone",    "fuse.s3fs",    "fuse.seaweedfs", "fuse.sshfs"};

std::filesystem::path directory_of(const std::filesystem::path& path) {
  std::error_code error;
  const std::filesystem::path absolute = std::filesystem::absolute(path, error);
  return (error ? path : absolute).parent_path();
}

}  // namespace

std::string_view network_file_system_name(std::uint64_t type) {
  const auto* found = std::find_if(network_file_systems.begin(), network_file_systems.end(),
                                   [&](const FileSystemType& entry) { return entry.type == type; });
  return found == network_file_systems.end() ? std::string_view() : found->name;
}

std::string network_fuse_name(std::string_view mount_table, std::string_view device) {
  std::istringstream lines{std::string(mount_table)};
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string number, parent, device_of_line, word;
    words >> number >> parent >> device_of_line;
    if (device_of_line != device) continue;
    while (words >> word && word != "-") continue;
    if (words >> word && std::ranges::binary_search(network_fuse_types, word)) return word;
  }
  return {};
}

namespace {

std::string network_fuse_name_of(const std::string& directory) {
  struct stat status {};
  if (::stat(directory.c_str(), &status) != 0) return {};
  std::ostringstream mount_table;
  mount_table << std::ifstream("/proc/self/mountinfo").rdbuf();
  return network_fuse_name(mount_table.str(),
                           fmt::format("{}:{}", major(status.st_dev), minor(status.st_dev)));
}

}  // namespace

void check_directory_of(const std::filesystem::path& path) {
  const std::string directory = directory_of(path).string();
  struct statfs status {};
  if (statfs(directory.c_str(), &status) != 0) {
    throw StoreError(fmt::format("directory = {} ({})", directory, std::strerror(errno)));
  }
  // The kernel's types have 32 bits; f_type is signed and may have extended the uppermost.
  const auto type = static_cast<std::uint32_t>(status.f_type);
  const std::string name = type == fuse_type ? network_fuse_name_of(directory)
                                             : std::string(network_file_system_name(type));
  if (!name.empty()) {
    throw StoreError(
        fmt::format("directory = {} (is on the network file system {}, where a campaign "
                    "database may be damaged; use a local disk)",
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

namespace {

// Removes an unfinished file, its rollback journal with it.
void remove_draft(const std::filesystem::path& draft) {
  std::error_code ignored;
  std::filesystem::remove(draft, ignored);
  std::filesystem::remove(std::filesystem::path(draft).concat("-journal"), ignored);
}

// Not all file systems know how to keep what is there; the name was free a moment ago.
bool rename_to(const std::filesystem::path& draft, const std::filesystem::path& path,
               IfThere if_there) {
  if (if_there == IfThere::keep) {
    if (::renameat2(AT_FDCWD, draft.c_str(), AT_FDCWD, path.c_str(), RENAME_NOREPLACE) == 0) {
      return true;
    }
    if (errno != EINVAL && errno != ENOSYS) return false;
  }
  return ::rename(draft.c_str(), path.c_str()) == 0;
}

}  // namespace

void appear_complete(const std::filesystem::path& path, IfThere if_there,
                     const std::function<void(const std::filesystem::path& draft)>& write) {
  const std::filesystem::path draft = std::filesystem::path(path).concat(".unfinished");
  remove_draft(draft);
  try {
    write(draft);
    if (!rename_to(draft, path, if_there)) {
      throw StoreError(fmt::format("campaign database = {} (cannot be given its name: {})",
                                   path.string(), std::strerror(errno)));
    }
  } catch (...) {
    remove_draft(draft);
    throw;
  }
  synchronise_directory_of(path);
}

}  // namespace proofmass::coordinator::detail
