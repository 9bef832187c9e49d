// A library to preload into a program: below one directory the file system has no hard links, no
// permissions and no locks, as exFAT, SMB, Lustre without `flock` or some of FUSE.
//
//     PROOFMASS_POOR_DIRECTORY  Absolute path, without symbolic links.
//     PROOFMASS_POOR_MODE       With it everybody may read all files.
//     PROOFMASS_POOR_LOCKS      With it there are no locks, either; the number is their `errno`.

#include <dlfcn.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>

namespace {

bool is_below(const char* path) {
  const char* const directory = getenv("PROOFMASS_POOR_DIRECTORY");
  if (directory == nullptr) return false;
  char where[8192];
  if (path[0] != '/') {
    if (syscall(SYS_getcwd, where, 4096) < 0) return false;
    (void)snprintf(where + strlen(where), 4096, "/%s", path);
    path = where;
  }
  const size_t size = strlen(directory);
  return strncmp(path, directory, size) == 0 && path[size] == '/';
}

bool is_below(int descriptor) {
  char link[32];
  char path[4096];
  (void)snprintf(link, sizeof link, "/proc/self/fd/%d", descriptor);
  const long size = syscall(SYS_readlink, link, path, sizeof path - 1);
  if (size <= 0) return false;
  path[size] = '\0';
  return is_below(path);
}

int fail(int error) {
  errno = error;
  return -1;
}

bool lacks_locks(int descriptor) {
  const char* const error = getenv("PROOFMASS_POOR_LOCKS");
  return error != nullptr && is_below(descriptor) && fail(atoi(error)) < 0;
}

int control(const char* name, int descriptor, int command, void* argument) {
  const bool is_lock = command == F_SETLK || command == F_SETLKW || command == F_GETLK ||
                       command == F_OFD_SETLK || command == F_OFD_SETLKW || command == F_OFD_GETLK;
  if (is_lock && lacks_locks(descriptor)) return -1;
  using Function = int(int, int, ...);
  auto* const real = reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
  return real(descriptor, command, argument);
}

}  // namespace

// NOLINTBEGIN: names and types are those of the C library.
extern "C" {

int link(const char* from, const char* to) {
  if (is_below(to)) return fail(EPERM);
  return static_cast<int>(syscall(SYS_link, from, to));
}

int renameat2(int from_folder, const char* from, int to_folder, const char* to, unsigned flags) {
  if (flags != 0 && is_below(to)) return fail(EINVAL);
  return static_cast<int>(syscall(SYS_renameat2, from_folder, from, to_folder, to, flags));
}

int fchmod(int descriptor, mode_t mode) {
  if (is_below(descriptor)) return fail(EPERM);
  return static_cast<int>(syscall(SYS_fchmod, descriptor, mode));
}

int chmod(const char* path, mode_t mode) {
  if (is_below(path)) return fail(EPERM);
  return static_cast<int>(syscall(SYS_chmod, path, mode));
}

int stat(const char* path, struct stat* status) {
  const long code = syscall(SYS_newfstatat, AT_FDCWD, path, status, 0);
  if (code == 0 && getenv("PROOFMASS_POOR_MODE") != nullptr && is_below(path)) {
    status->st_mode |= 0755;
  }
  return static_cast<int>(code);
}

int flock(int descriptor, int operation) {
  if (lacks_locks(descriptor)) return -1;
  return static_cast<int>(syscall(SYS_flock, descriptor, operation));
}

int fcntl(int descriptor, int command, ...) {
  va_list arguments;
  va_start(arguments, command);
  void* const argument = va_arg(arguments, void*);
  va_end(arguments);
  return control("fcntl", descriptor, command, argument);
}

int fcntl64(int descriptor, int command, ...) {
  va_list arguments;
  va_start(arguments, command);
  void* const argument = va_arg(arguments, void*);
  va_end(arguments);
  return control("fcntl64", descriptor, command, argument);
}

}  // extern "C"
// NOLINTEND
