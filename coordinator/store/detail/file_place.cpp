#include "coordinator/store/detail/file_place.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sqlite3.h>
#include <sys/stat.h>
#include <sys/statfs.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <memory>
#include <sstream>
#include <string>
#include <string_view>
#include <system_error>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/records.hpp"
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

// SQLite's file format, section 4.1: a log begins with this number, whose last bit is the byte
// order of its checksums; 32 bytes are followed by frames of a header of 24 bytes and a page.
constexpr std::uint32_t log_magic = 0x377f0682;
constexpr std::size_t log_header_size = 32;
constexpr std::size_t frame_header_size = 24;

// By its canonical name, so that a directory that the process leaves changes nothing.
std::filesystem::path canonical_path(const std::filesystem::path& path) {
  std::error_code error;
  std::filesystem::path result = std::filesystem::weakly_canonical(path, error);
  return error ? path : result;
}

// Of a canonical name, as SQLite has opened it: whatever a symbolic link that took the name since
// leads to has other files beside it.
std::filesystem::path beside(std::filesystem::path canonical, std::string_view ending) {
  return canonical.concat(ending);
}

std::string holder(const std::filesystem::path& path) {
  std::string line;
  std::getline(std::ifstream(path), line);
  return line.empty() ? "another process" : line;
}

wire::Descriptor open_lock_file(const std::filesystem::path& path) {
  try {
    return wire::Descriptor(
        wire::open_own_file("lock", path, wire::IfAbsent::make, wire::trusted_mode));
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

wire::Descriptor acquire(const std::filesystem::path& path, IfNoLocks if_no_locks) {
  wire::Descriptor descriptor = open_lock_file(path);
  const wire::Locked locked = wire::lock_file(descriptor.number());
  const bool is_enough = locked == wire::Locked::yes ||
                         (locked == wire::Locked::impossible && if_no_locks == IfNoLocks::go_on);
  if (is_enough && is_file_at(descriptor.number(), path)) return descriptor;
  if (locked == wire::Locked::impossible) {
    throw StoreError(fmt::format("lock = {} ({})", path.string(), wire::no_locks_remedy));
  }
  throw StoreError(fmt::format("lock = {} (held by {}; a campaign has one coordinator at a time)",
                               path.string(), holder(path)));
}

wire::Descriptor open_and_lock(const std::filesystem::path& path) {
  wire::Descriptor descriptor(::open(path.c_str(), O_RDWR | O_CLOEXEC));
  if (descriptor.number() < 0) {
    const int error = errno;
    if (error == EACCES || error == EROFS) refuse_file(path, "is not writable");
    refuse_file(path, fmt::format("cannot be opened: {}", std::strerror(error)));
  }
  const wire::Locked locked = wire::lock_file(descriptor.number());
  if (locked == wire::Locked::yes) return descriptor;
  refuse_file(path, locked == wire::Locked::impossible
                        ? wire::no_locks_remedy
                        : "another coordinator has it; a campaign has one coordinator at a time");
}

[[noreturn]] void refuse_to_make(const std::filesystem::path& file, std::string_view kind,
                                 const std::filesystem::path& other) {
  refuse_file(file,
              fmt::format("is gone, but its {0} {1} is there: {2}, or move {1} away and begin "
                          "anew",
                          kind, other.filename().string(),
                          kind == "copy" ? "give it the name" : "put the file back"));
}

// A copy that Store::check_place() made of a file with this name; empty if there is none.
std::filesystem::path recovered_copy_of(const std::filesystem::path& file) {
  const std::string beginning = file.stem().string() + ".recovered-";
  std::error_code error;
  std::filesystem::directory_iterator item(wire::directory_of(file), error);
  for (; !error && item != std::filesystem::directory_iterator(); item.increment(error)) {
    const bool is_copy = item->path().filename().string().starts_with(beginning);
    if (is_copy && item->path().extension() == file.extension()) return item->path();
  }
  return {};
}

constexpr std::string_view truncated =
    "was truncated or written over while it was served: what it held is lost; stop the "
    "coordinator, put a copy back, and what the copy lacks is computed again";

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
  if (!std::filesystem::status_known(status)) {
    refuse_file(path, fmt::format("cannot be reached: {}", std::strerror(error.value())));
  }
  refuse_file(path, std::filesystem::exists(status) ? "is no file" : "does not exist");
}

void appear_complete(const std::filesystem::path& path,
                     const std::function<void(const std::filesystem::path& draft)>& write) {
  try {
    wire::DraftFile file("campaign database", path, wire::trusted_mode, ".unfinished");
    write(file.draft());
    file.publish(wire::IfThere::keep);
  } catch (const StoreError&) {
    throw;
  } catch (const Error& error) {
    throw StoreError(error.what());
  }
}

std::filesystem::path log_path(const std::filesystem::path& file) {
  return beside(canonical_path(file), "-wal");
}

std::filesystem::path journal_path(const std::filesystem::path& file) {
  return beside(canonical_path(file), "-journal");
}

bool has_log(const std::filesystem::path& file) {
  std::ifstream stream(log_path(file), std::ios::binary);
  std::array<unsigned char, log_header_size + frame_header_size + 1> bytes{};
  stream.read(reinterpret_cast<char*>(bytes.data()), bytes.size());
  if (!stream) return false;
  std::uint32_t magic = 0;
  for (std::size_t i = 0; i < sizeof magic; ++i) magic = magic << 8 | bytes[i];
  return (magic & ~std::uint32_t{1}) == log_magic;
}

// Without a Database: that would ask this function what to say of an error.
std::string fault_without_log(const std::filesystem::path& file) {
  sqlite3* opened = nullptr;
  const int code = sqlite3_open_v2(file_uri(file, "immutable=1").c_str(), &opened,
                                   SQLITE_OPEN_READONLY | SQLITE_OPEN_URI, nullptr);
  const std::unique_ptr<sqlite3, int (*)(sqlite3*)> connection(opened, &sqlite3_close_v2);
  if (code != SQLITE_OK) return sqlite3_errmsg(opened);
  std::string finding;
  const auto take = [](void* result, int, char** texts, char**) {
    *static_cast<std::string*>(result) = texts[0] == nullptr ? "" : texts[0];
    return 0;
  };
  const int end = sqlite3_exec(opened, "PRAGMA trusted_schema = OFF; PRAGMA integrity_check(1)",
                               take, &finding, nullptr);
  if (end != SQLITE_OK) return sqlite3_errmsg(opened);
  if (finding == "ok") return {};
  // A line that names the database may come first.
  return finding.substr(finding.find('\n') + 1);
}

void check_absence(const std::filesystem::path& file) {
  std::error_code ignored;
  if (std::filesystem::exists(file, ignored)) refuse_file(file, "exists already");
  if (has_log(file)) refuse_to_make(file, "log", log_path(file));
  const std::uintmax_t journal_size = std::filesystem::file_size(journal_path(file), ignored);
  if (!ignored && journal_size > 0) refuse_to_make(file, "journal", journal_path(file));
  const std::filesystem::path copy = recovered_copy_of(file);
  if (!copy.empty()) refuse_to_make(file, "copy", copy);
}

StoreLock::StoreLock(const std::filesystem::path& campaign_file, IfNoLocks if_no_locks)
    : path_(beside(canonical_path(campaign_file), ".lock")),
      descriptor_(acquire(path_, if_no_locks)) {
  // For people only: the lock holds even if this cannot be written.
  if (::ftruncate(descriptor_.number(), 0) != 0) return;
  (void)wire::write_all(descriptor_.number(),
                        fmt::format("process {} on {}\n", ::getpid(), wire::host_name()));
}

// Somebody may have removed the file, and another process may have made one.
StoreLock::~StoreLock() {
  if (is_file_at(descriptor_.number(), path_)) ::unlink(path_.c_str());
}

FilePlace::FilePlace(const std::filesystem::path& file)
    : path_(canonical_path(file)), descriptor_(open_and_lock(path_)), file_(identity_at(path_)) {}

FilePlace::Identity FilePlace::identity_at(const std::filesystem::path& path) {
  struct stat status {};
  if (::stat(path.c_str(), &status) == 0) return {status.st_dev, status.st_ino};
  if (errno == ENOENT || errno == ENOTDIR) return {};
  refuse_file(path, fmt::format("cannot be reached: {}", std::strerror(errno)));
}

void FilePlace::remember_log() {
  log_ = identity_at(beside(path_, "-wal"));
  index_ = identity_at(beside(path_, "-shm"));
}

std::string_view FilePlace::look() {
  if (is_lost()) return loss_;
  struct stat status {};
  if (::fstat(descriptor_.number(), &status) == 0) {
    if (status.st_size < size_max_) return loss_ = truncated;
    size_max_ = status.st_size;
  }
  const Identity present = identity_at(path_);
  if (present == Identity{}) {
    loss_ = "was removed or renamed while it was served";
  } else if (present != file_) {
    loss_ = "was replaced by another file while it was served";
  } else if (identity_at(beside(path_, "-wal")) != log_) {
    loss_ = "lost its write-ahead log, which was removed while it was served";
  }
  return loss_;
}

bool FilePlace::is_truncated() const { return loss_ == truncated; }

void FilePlace::remove_own_log() const {
  const auto remove = [](const std::filesystem::path& path, const Identity& own) {
    if (own != Identity{} && identity_at(path) == own) ::unlink(path.c_str());
  };
  remove(beside(path_, "-wal"), log_);
  remove(beside(path_, "-shm"), index_);
}

}  // namespace proofmass::coordinator::detail
