#include "coordinator/store/detail/file_place.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <system_error>

#include "coordinator/store/detail/file_log.hpp"
#include "coordinator/store/store_error.hpp"

namespace proofmass::coordinator::detail {
namespace {

// By its canonical name, so that a directory that the process leaves changes nothing.
std::filesystem::path canonical_path(const std::filesystem::path& path) {
  std::error_code error;
  std::filesystem::path result = std::filesystem::weakly_canonical(path, error);
  return error ? path : result;
}

std::filesystem::path index_path(const std::filesystem::path& file) {
  return std::filesystem::path(file).concat("-shm");
}

void remove_file(const std::filesystem::path& path) {
  if (::unlink(path.c_str()) == 0 || errno == ENOENT) return;
  throw StoreError(
      fmt::format("file = {} (cannot be removed: {})", path.string(), std::strerror(errno)));
}

int open_and_lock(const std::filesystem::path& path) {
  const int descriptor = ::open(path.c_str(), O_RDWR | O_CLOEXEC);
  if (descriptor < 0) {
    const int error = errno;
    throw StoreError(fmt::format("campaign file = {} ({})", path.string(),
                                 error == EACCES || error == EROFS
                                     ? std::string("is not writable")
                                     : fmt::format("cannot be opened: {}", std::strerror(error))));
  }
  if (::flock(descriptor, LOCK_EX | LOCK_NB) == 0) return descriptor;
  ::close(descriptor);
  throw StoreError(
      fmt::format("campaign file = {} (another coordinator has it; a campaign has one coordinator "
                  "at a time)",
                  path.string()));
}

}  // namespace

FilePlace::FilePlace(const std::filesystem::path& file)
    : path_(canonical_path(file)), descriptor_(open_and_lock(path_)), file_(identity_at(path_)) {}

FilePlace::~FilePlace() { ::close(descriptor_); }

FilePlace::Identity FilePlace::identity_at(const std::filesystem::path& path) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0) return {};
  return {.device = status.st_dev, .number = status.st_ino};
}

void FilePlace::remember_log() {
  log_ = identity_at(log_path(path_));
  index_ = identity_at(index_path(path_));
}

Placement FilePlace::look() const {
  const Identity present = identity_at(path_);
  if (present == file_) {
    return identity_at(log_path(path_)) == log_ ? Placement::in_place : Placement::log_removed;
  }
  if (present != Identity{}) return Placement::replaced;
  std::error_code ignored;
  return std::filesystem::is_directory(path_.parent_path(), ignored) ? Placement::removed
                                                                     : Placement::without_directory;
}

void FilePlace::remove_own_log() const {
  if (log_ != Identity{} && identity_at(log_path(path_)) == log_) remove_file(log_path(path_));
  if (index_ != Identity{} && identity_at(index_path(path_)) == index_) {
    remove_file(index_path(path_));
  }
}

void remove_log_of(const std::filesystem::path& file) {
  remove_file(log_path(file));
  remove_file(index_path(file));
}

}  // namespace proofmass::coordinator::detail
