#include "coordinator/store/detail/store_lock.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <string>
#include <system_error>

#include "coordinator/store/store_error.hpp"
#include "proto/link/machine.hpp"

namespace proofmass::coordinator::detail {
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
  const int descriptor = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (descriptor >= 0) return descriptor;
  const int error = errno;
  throw StoreError(
      fmt::format("lock = {} (cannot be created: {}; the directory of a campaign database "
                  "must be writable)",
                  path.string(), std::strerror(error)));
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

int acquire(const std::filesystem::path& path) {
  const int descriptor = open_lock_file(path);
  if (::flock(descriptor, LOCK_EX | LOCK_NB) == 0 && is_file_at(descriptor, path))
    return descriptor;
  ::close(descriptor);
  throw StoreError(fmt::format("lock = {} (held by {}; a campaign has one coordinator at a time)",
                               path.string(), holder(path)));
}

}  // namespace

StoreLock::StoreLock(const std::filesystem::path& campaign_file)
    : path_(lock_path(campaign_file)), descriptor_(acquire(path_)) {
  // For people only: the lock holds even if this cannot be written.
  std::ofstream(path_) << this_process() << '\n';
}

// Somebody may have removed the file, and another process may have made one.
StoreLock::~StoreLock() {
  if (is_in_place()) ::unlink(path_.c_str());
  ::close(descriptor_);
}

bool StoreLock::is_in_place() const { return is_file_at(descriptor_, path_); }

}  // namespace proofmass::coordinator::detail
