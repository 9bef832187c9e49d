#include "coordinator/net/private_endpoint.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string_view>
#include <system_error>
#include <utility>

#include "core/error.hpp"
#include "proto/link/whole_file.hpp"

namespace proofmass::coordinator {
namespace {

constexpr std::string_view prefix = "proofmass-run-";
constexpr std::string_view draft_prefix = "proofmass-new-";
constexpr std::size_t random_size = 6;
constexpr const char* lock_name = "lock";
constexpr const char* socket_name = "workers";

std::filesystem::path parent_directory() {
  // The temporary directory may be deep, but a socket's path has 107 bytes at most.
  std::error_code ignored;
  std::filesystem::path parent = std::filesystem::temp_directory_path(ignored);
  if (ignored || parent.string().size() > 70) parent = "/tmp";
  return parent;
}

[[noreturn]] void fail(const std::string& directory) {
  throw Error(fmt::format("temporary directory = {} ({})", directory, std::strerror(errno)));
}

/// A new directory, and the lock in it, which this process holds.
struct LockedDirectory {
  std::filesystem::path path;
  wire::Descriptor lock;
};

// It gets its name when its lock is held: until then nobody takes it for one that was left behind.
LockedDirectory make_directory(const std::filesystem::path& parent) {
  std::string draft = (parent / draft_prefix).string() + std::string(random_size, 'X');
  if (mkdtemp(draft.data()) == nullptr) fail(draft);
  const std::filesystem::path lock_file = std::filesystem::path(draft) / lock_name;
  const std::filesystem::path path =
      parent / (std::string(prefix) + draft.substr(draft.size() - random_size));
  wire::Descriptor lock(open(lock_file.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0600));
  if (lock.number() >= 0 && wire::lock_file(lock.number()) == wire::Locked::yes &&
      rename(draft.c_str(), path.c_str()) == 0) {
    return {.path = path, .lock = std::move(lock)};
  }
  const int error = errno;
  unlink(lock_file.c_str());
  rmdir(draft.c_str());
  errno = error;
  fail(draft);
}

/// Removes the two files that are known, and the directory if there is nothing else in it.
void remove_directory(int parent, const char* name, int directory) {
  unlinkat(directory, socket_name, 0);
  unlinkat(directory, lock_name, 0);
  unlinkat(parent, name, AT_REMOVEDIR);
}

bool is_private(int directory) {
  struct stat status {};
  return fstat(directory, &status) == 0 && status.st_uid == geteuid() &&
         (status.st_mode & 07777U) == S_IRWXU;
}

void remove_if_stale(int parent, const char* name) {
  const wire::Descriptor opened(
      openat(parent, name, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC));
  const int directory = opened.number();
  if (directory < 0 || !is_private(directory)) return;
  const wire::Descriptor lock(
      openat(directory, lock_name, O_RDWR | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
  // While its process lives, also one in another container, the lock is held.
  const bool is_stale = lock.number() >= 0 && wire::lock_file(lock.number()) == wire::Locked::yes;
  if (is_stale) remove_directory(parent, name, directory);
}

}  // namespace

void remove_stale_endpoints(const std::filesystem::path& parent) {
  const wire::Descriptor opened(open(parent.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (opened.number() < 0) return;
  std::error_code error;
  for (std::filesystem::directory_iterator entry(parent, error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (name.starts_with(prefix) && name.size() == prefix.size() + random_size) {
      remove_if_stale(opened.number(), name.c_str());
    }
  }
}

PrivateEndpoint::PrivateEndpoint() {
  const std::filesystem::path parent = parent_directory();
  remove_stale_endpoints(parent);
  LockedDirectory made = make_directory(parent);
  directory_ = std::move(made.path);
  lock_ = std::move(made.lock);
}

PrivateEndpoint::~PrivateEndpoint() {
  unlink((directory_ / socket_name).c_str());
  unlink((directory_ / lock_name).c_str());
  rmdir(directory_.c_str());
}

std::string PrivateEndpoint::address() const {
  return "ipc://" + (directory_ / socket_name).string();
}

int PrivateEndpoint::listen() const {
  const std::string path = (directory_ / socket_name).string();
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  PROOFMASS_EXPECT(path.size() < sizeof address.sun_path);
  path.copy(address.sun_path, path.size());
  wire::Descriptor listener(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  // The interface of sockets takes addresses of all families as this type.
  const auto* const any = reinterpret_cast<const sockaddr*>(&address);
  if (listener.number() < 0 || bind(listener.number(), any, sizeof address) != 0 ||
      ::listen(listener.number(), SOMAXCONN) != 0) {
    fail(path);
  }
  return listener.release();
}

}  // namespace proofmass::coordinator
