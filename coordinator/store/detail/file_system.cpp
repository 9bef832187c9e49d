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
#include "proto/link/machine.hpp"

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
  const std::string directory = wire::directory_of(path).string();
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

void check_presence(const std::filesystem::path& path) {
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(path, error);
  if (std::filesystem::is_regular_file(status)) return;
  const auto refuse = [&](std::string_view why) {
    throw StoreError(fmt::format("campaign database = {} ({})", path.string(), why));
  };
  if (!std::filesystem::status_known(status)) {
    refuse(fmt::format("cannot be reached: {}", std::strerror(error.value())));
  }
  refuse(std::filesystem::exists(status) ? "is no file" : "does not exist");
}

void appear_complete(const std::filesystem::path& path, wire::IfThere if_there,
                     const std::function<void(const std::filesystem::path& draft)>& write) {
  try {
    wire::DraftFile file("campaign database", path, wire::trusted_mode, ".unfinished");
    write(file.draft());
    file.publish(if_there);
  } catch (const StoreError&) {
    throw;
  } catch (const Error& error) {
    throw StoreError(error.what());
  }
}

namespace {

std::string this_process() {
  return fmt::format("process {} on {}", ::getpid(), wire::host_name());
}

std::string holder(const std::filesystem::path& path) {
  std::string line;
  std::getline(std::ifstream(path), line);
  return line.empty() ? "another process" : line;
}

int open_lock_file(const std::filesystem::path& path) {
  try {
    return wire::open_own_file("lock", path, wire::IfAbsent::make, wire::trusted_mode);
  } catch (const Error& error) {
    throw StoreError(error.what());
  }
}

// False if the last holder removed the file between our opening and locking it.
bool is_file_at(int descriptor, const std::filesystem::path& path) {
  struct stat opened {};
  struct stat present {};
  return ::fstat(descriptor, &opened) == 0 && ::stat(path.c_str(), &present) == 0 &&
         opened.st_dev == present.st_dev && opened.st_ino == present.st_ino;
}

std::filesystem::path lock_path(const std::filesystem::path& campaign_file) {
  std::error_code error;
  std::filesystem::path path = std::filesystem::weakly_canonical(campaign_file, error);
  if (error) path = campaign_file;
  return path.concat(".lock");
}

int acquire(const std::filesystem::path& path, IfNoLocks if_no_locks) {
  const int descriptor = open_lock_file(path);
  const wire::Locked locked = wire::lock_file(descriptor);
  const bool is_enough = locked == wire::Locked::yes ||
                         (locked == wire::Locked::impossible && if_no_locks == IfNoLocks::go_on);
  if (is_enough && is_file_at(descriptor, path)) return descriptor;
  ::close(descriptor);
  if (locked == wire::Locked::impossible) {
    throw StoreError(fmt::format("lock = {} ({})", path.string(), wire::no_locks_remedy));
  }
  throw StoreError(fmt::format("lock = {} (held by {}; a campaign has one coordinator at a time)",
                               path.string(), holder(path)));
}

}  // namespace

StoreLock::StoreLock(const std::filesystem::path& campaign_file, IfNoLocks if_no_locks)
    : path_(lock_path(campaign_file)), descriptor_(acquire(path_, if_no_locks)) {
  // For people only: the lock holds even if this cannot be written.
  if (::ftruncate(descriptor_, 0) != 0) return;
  const std::string text = this_process() + '\n';
  [[maybe_unused]] const ssize_t written = ::write(descriptor_, text.data(), text.size());
}

// Somebody may have removed the file, and another process may have made one.
StoreLock::~StoreLock() {
  if (is_in_place()) ::unlink(path_.c_str());
  ::close(descriptor_);
}

bool StoreLock::is_in_place() const { return is_file_at(descriptor_, path_); }

}  // namespace proofmass::coordinator::detail
