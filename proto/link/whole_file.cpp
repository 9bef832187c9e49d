#include "proto/link/whole_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <system_error>
#include <utility>

#include "core/error.hpp"

namespace proofmass::wire {
namespace {

[[noreturn]] void refuse(std::string_view what, const std::filesystem::path& file,
                         std::string_view rule) {
  throw Error(fmt::format("{} = {} ({})", what, file.string(), rule));
}

bool is_unknown_to_file_system(int error_number) {
  return error_number == EINVAL || error_number == ENOSYS || error_number == EOPNOTSUPP;
}

/// Makes a file, or the entries of a directory, durable where the file system has a way to.
int synchronise(const std::filesystem::path& path) {
  const Descriptor opened(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (opened.number() < 0) return errno;
  const int error_number = ::fsync(opened.number()) == 0 ? 0 : errno;
  return is_unknown_to_file_system(error_number) ? 0 : error_number;
}

// SQLite may have left a rollback journal beside an unfinished database.
void remove_draft(const std::filesystem::path& draft) {
  std::error_code ignored;
  std::filesystem::remove(draft, ignored);
  std::filesystem::remove(std::filesystem::path(draft).concat("-journal"), ignored);
}

// Not all file systems know how to keep what is there; the name was free a moment ago.
int rename_to(const std::filesystem::path& draft, const std::filesystem::path& path,
              IfThere if_there) {
  if (if_there == IfThere::keep) {
    if (::renameat2(AT_FDCWD, draft.c_str(), AT_FDCWD, path.c_str(), RENAME_NOREPLACE) == 0) {
      return 0;
    }
    if (!is_unknown_to_file_system(errno)) return errno;
    std::error_code ignored;
    if (std::filesystem::exists(std::filesystem::symlink_status(path, ignored))) return EEXIST;
  }
  return ::rename(draft.c_str(), path.c_str()) == 0 ? 0 : errno;
}

/// Empty if the file is this user's.
std::string rule_of_owner(const struct stat& status) {
  if (status.st_uid == ::geteuid()) return {};
  return fmt::format("owner = user {}; must be owned by user {}, who runs this program",
                     status.st_uid, ::geteuid());
}

bool is_others_business(const std::filesystem::path& file) {
  struct stat status {};
  return ::stat(file.c_str(), &status) != 0 || (status.st_mode & 077) != 0;
}

[[noreturn]] void fail(std::string_view what) {
  throw Error(fmt::format("temporary file: {}: {}", what, std::strerror(errno)));
}

}  // namespace

UnnamedFile::UnnamedFile(int descriptor) : descriptor_(descriptor) {
  if (descriptor < 0) fail("open");
}

std::uint64_t UnnamedFile::size() const {
  struct stat status {};
  if (::fstat(descriptor(), &status) != 0) fail("size");
  return static_cast<std::uint64_t>(status.st_size);
}

std::string UnnamedFile::read(std::uint64_t offset, std::size_t size_max) const {
  std::string bytes(size_max, '\0');
  std::size_t size = 0;
  while (size < size_max) {
    const ssize_t num_read = ::pread(descriptor(), bytes.data() + size, size_max - size,
                                     static_cast<off_t>(offset + size));
    if (num_read < 0 && errno == EINTR) continue;
    if (num_read < 0) fail("read");
    if (num_read == 0) break;
    size += static_cast<std::size_t>(num_read);
  }
  bytes.resize(size);
  return bytes;
}

DraftFile::DraftFile(std::string_view what, std::filesystem::path path, mode_t mode,
                     std::string_view ending)
    : what_(what), path_(std::move(path)), draft_(path_) {
  draft_.concat(ending.empty() ? fmt::format(".{}.new", ::getpid()) : std::string(ending));
  remove_draft(draft_);
  const Descriptor made(
      ::open(draft_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, mode));
  if (made.number() < 0) fail(errno);
}

DraftFile::~DraftFile() {
  if (!is_published_) remove_draft(draft_);
}

void DraftFile::write(std::string_view text) const {
  const Descriptor opened(::open(draft_.c_str(), O_WRONLY | O_APPEND | O_NOFOLLOW | O_CLOEXEC));
  if (opened.number() < 0 || !write_all(opened.number(), text)) fail(errno);
}

void DraftFile::publish(IfThere if_there) {
  struct stat before {};
  if (if_there == IfThere::replace && ::stat(path_.c_str(), &before) == 0) {
    (void)::chmod(draft_.c_str(), before.st_mode & 0777);  // Not all file systems know it.
  }
  if (const int error_number = publish_file(draft_, path_, if_there)) fail(error_number);
  is_published_ = true;
}

void DraftFile::fail(int error_number) const {
  refuse(what_, path_, fmt::format("cannot be written: {}", std::strerror(error_number)));
}

void write_whole_file(std::string_view what, const std::filesystem::path& file,
                      std::string_view text, mode_t mode, IfThere if_there) {
  DraftFile draft(what, file, mode);
  if ((mode & 077) == 0 && is_others_business(draft.draft())) {
    refuse(what, file, "cannot be written: its file system would let other users read it");
  }
  draft.write(text);
  draft.publish(if_there);
}

int publish_file(const std::filesystem::path& draft, const std::filesystem::path& path,
                 IfThere if_there) {
  int error_number = synchronise(draft);
  if (error_number == 0) error_number = rename_to(draft, path, if_there);
  return error_number == 0 ? synchronise_directory_of(path) : error_number;
}

std::filesystem::path directory_of(const std::filesystem::path& path) {
  std::error_code error;
  const std::filesystem::path absolute = std::filesystem::absolute(path, error);
  return (error ? path : absolute).parent_path();
}

int synchronise_directory_of(const std::filesystem::path& path) {
  return synchronise(directory_of(path));
}

// Opening a pipe must not wait for its other end. A second name could be that of any file.
int open_own_file(std::string_view what, const std::filesystem::path& file, IfAbsent if_absent,
                  mode_t mode) {
  const int flags = O_RDWR | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC;
  const bool is_made = if_absent == IfAbsent::make;
  Descriptor opened(::open(file.c_str(), is_made ? flags | O_CREAT : flags, mode));
  if (opened.number() < 0) {
    if (errno == ENOENT && !is_made) return -1;
    refuse(what, file, errno == ELOOP ? "must not be a symbolic link" : std::strerror(errno));
  }
  struct stat status {};
  if (::fstat(opened.number(), &status) != 0) refuse(what, file, std::strerror(errno));
  if (!S_ISREG(status.st_mode) || status.st_nlink > 1) {
    refuse(what, file, "must be a regular file with one name");
  }
  const std::string rule = rule_of_owner(status);
  if (!rule.empty()) refuse(what, file, rule);
  return opened.release();
}

Locked lock_file(int descriptor) {
  if (::flock(descriptor, LOCK_EX | LOCK_NB) == 0) return Locked::yes;
  return errno == EWOULDBLOCK ? Locked::by_another : Locked::impossible;
}

bool write_all(int descriptor, std::string_view text) {
  while (!text.empty()) {
    const ssize_t written = ::write(descriptor, text.data(), text.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return false;
    text.remove_prefix(static_cast<std::size_t>(written));
  }
  return true;
}

void check_reach(std::string_view what, const std::filesystem::path& file,
                 const struct stat& status, Reach reach) {
  const bool is_private = reach == Reach::private_to_owner;
  const std::string owner = rule_of_owner(status);
  if (!owner.empty() && (is_private || status.st_uid != 0)) refuse(what, file, owner);
  const mode_t mode = status.st_mode & 07777;
  if ((mode & (is_private ? 077 : 022)) == 0) return;
  refuse(what, file,
         fmt::format("mode {:04o}; must be {}", mode,
                     is_private ? "readable by its owner alone: chmod 600"
                                : "writable by its owner alone: chmod go-w"));
}

// Opening a pipe must not wait for its other end.
std::string read_within_reach(std::string_view what, const std::filesystem::path& file, Reach reach,
                              std::size_t size_max) {
  const Descriptor opened(::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  struct stat status {};
  if (opened.number() < 0 || ::fstat(opened.number(), &status) != 0) {
    refuse(what, file, std::strerror(errno));
  }
  if (!S_ISREG(status.st_mode)) refuse(what, file, "must be a regular file");
  check_reach(what, file, status, reach);
  if (static_cast<std::size_t>(status.st_size) > size_max) refuse(what, file, "is too large");
  std::string text(static_cast<std::size_t>(status.st_size), '\0');
  const ssize_t size = ::read(opened.number(), text.data(), text.size());
  if (size < 0) refuse(what, file, std::strerror(errno));
  text.resize(static_cast<std::size_t>(size));
  return text;
}

}  // namespace proofmass::wire
