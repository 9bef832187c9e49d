// A library to preload into a program: system calls on files below one directory fail as another
// process says. That process writes to a file of thirteen 32-bit numbers (`Orders`), which this
// one maps, so that faults begin and end while the program runs.
//
//     PROOFMASS_FAULTY_DIRECTORY  Absolute path; calls on files elsewhere are left alone.
//     PROOFMASS_FAULTY_ORDERS     The file with the numbers; without it nothing fails.

#include <dlfcn.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <type_traits>

namespace {

/// Bits of `Orders::calls`.
enum Call : uint32_t {
  call_open = 1U << 0,
  call_write = 1U << 1,
  call_sync = 1U << 2,
  call_rename = 1U << 3,
  call_truncate = 1U << 4,
  call_map = 1U << 5,
  call_link = 1U << 6,
  call_unlink = 1U << 7,
};

/// What is shared with the process that gives the orders.
struct Orders {
  std::atomic<uint32_t> calls;       ///< Which calls count; 0: none.
  std::atomic<uint32_t> error;       ///< The `errno` with which they fail.
  std::atomic<uint32_t> first;       ///< The first that fails, from 1.
  std::atomic<uint32_t> last;        ///< The last that fails.
  std::atomic<uint32_t> count;       ///< Of calls that counted so far, in all processes.
  std::atomic<uint32_t> tallies[8];  ///< The same, of each kind.
};
static_assert(sizeof(Orders) == 13 * sizeof(uint32_t));

const char* directory = nullptr;
size_t directory_size = 0;
Orders* orders = nullptr;

[[gnu::constructor]] void read_environment() {
  directory = getenv("PROOFMASS_FAULTY_DIRECTORY");
  const char* const file = getenv("PROOFMASS_FAULTY_ORDERS");
  if (directory == nullptr || file == nullptr) return;
  directory_size = strlen(directory);
  const long descriptor = syscall(SYS_openat, AT_FDCWD, file, O_RDWR | O_CLOEXEC);
  if (descriptor < 0) return;
  void* const memory = reinterpret_cast<void*>(syscall(
      SYS_mmap, nullptr, sizeof(Orders), PROT_READ | PROT_WRITE, MAP_SHARED, descriptor, 0L));
  if (memory != MAP_FAILED) orders = static_cast<Orders*>(memory);
  syscall(SYS_close, descriptor);
}

bool is_below(const char* path) {
  return strncmp(path, directory, directory_size) == 0 && path[directory_size] == '/';
}

bool is_descriptor_below(int descriptor) {
  char link[32];
  char path[4096];
  (void)snprintf(link, sizeof link, "/proc/self/fd/%d", descriptor);
  const long size = syscall(SYS_readlink, link, path, sizeof path - 1);
  if (size <= 0) return false;
  path[size] = '\0';
  return is_below(path);
}

bool is_path_below(int folder, const char* path) {
  if (path[0] == '/') return is_below(path);
  char where[4096];
  if (folder != AT_FDCWD) return is_descriptor_below(folder);
  if (syscall(SYS_getcwd, where, sizeof where) < 0) return false;
  const size_t size = strlen(where);
  if (size + strlen(path) + 2 > sizeof where) return false;
  where[size] = '/';
  strcpy(where + size + 1, path);
  return is_below(where);
}

/// Counts a call on such a file. @return True if it fails, with `errno` set.
bool count(Call call) {
  orders->tallies[__builtin_ctz(call)].fetch_add(1);
  const uint32_t number = orders->count.fetch_add(1) + 1;
  if (number < orders->first || number > orders->last) return false;
  errno = static_cast<int>(orders->error.load());
  return true;
}

bool is_ordered(Call call) { return orders != nullptr && (orders->calls & call) != 0; }
bool fails(Call call, int descriptor) {
  return is_ordered(call) && descriptor >= 0 && is_descriptor_below(descriptor) && count(call);
}
bool fails(Call call, int folder, const char* path) {
  return is_ordered(call) && is_path_below(folder, path) && count(call);
}

/// The function that this one stands before.
template <typename Function>
Function* next(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

mode_t mode_of(int flags, va_list arguments) {
  const bool has_mode = (flags & (O_CREAT | O_TMPFILE)) != 0;
  return has_mode ? static_cast<mode_t>(va_arg(arguments, int)) : 0;
}

int open_at(int folder, const char* path, int flags, mode_t mode) {
  if (fails(call_open, folder, path)) return -1;
  return static_cast<int>(syscall(SYS_openat, folder, path, flags, mode));
}

}  // namespace

// NOLINTBEGIN: names and types are those of the C library.
extern "C" {

int open(const char* path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  const mode_t mode = mode_of(flags, arguments);
  va_end(arguments);
  return open_at(AT_FDCWD, path, flags, mode);
}

int open64(const char* path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  const mode_t mode = mode_of(flags, arguments);
  va_end(arguments);
  return open_at(AT_FDCWD, path, flags, mode);
}

int openat(int folder, const char* path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  const mode_t mode = mode_of(flags, arguments);
  va_end(arguments);
  return open_at(folder, path, flags, mode);
}

FILE* fopen(const char* path, const char* mode) {
  static const auto real = next<FILE*(const char*, const char*)>("fopen");
  return fails(call_open, AT_FDCWD, path) ? nullptr : real(path, mode);
}

FILE* fopen64(const char* path, const char* mode) {
  static const auto real = next<FILE*(const char*, const char*)>("fopen64");
  return fails(call_open, AT_FDCWD, path) ? nullptr : real(path, mode);
}

ssize_t write(int descriptor, const void* bytes, size_t size) {
  if (fails(call_write, descriptor)) return -1;
  return syscall(SYS_write, descriptor, bytes, size);
}

ssize_t writev(int descriptor, const iovec* parts, int count) {
  if (fails(call_write, descriptor)) return -1;
  return syscall(SYS_writev, descriptor, parts, count);
}

ssize_t pwrite(int descriptor, const void* bytes, size_t size, off_t offset) {
  if (fails(call_write, descriptor)) return -1;
  return syscall(SYS_pwrite64, descriptor, bytes, size, offset);
}

ssize_t pwrite64(int descriptor, const void* bytes, size_t size, off64_t offset) {
  if (fails(call_write, descriptor)) return -1;
  return syscall(SYS_pwrite64, descriptor, bytes, size, offset);
}

int fsync(int descriptor) {
  if (fails(call_sync, descriptor)) return -1;
  return static_cast<int>(syscall(SYS_fsync, descriptor));
}

int fdatasync(int descriptor) {
  if (fails(call_sync, descriptor)) return -1;
  return static_cast<int>(syscall(SYS_fdatasync, descriptor));
}

int ftruncate(int descriptor, off_t size) {
  if (fails(call_truncate, descriptor)) return -1;
  return static_cast<int>(syscall(SYS_ftruncate, descriptor, size));
}

int ftruncate64(int descriptor, off64_t size) {
  if (fails(call_truncate, descriptor)) return -1;
  return static_cast<int>(syscall(SYS_ftruncate, descriptor, size));
}

void* mmap(void* at, size_t size, int protection, int flags, int descriptor, off_t offset) {
  if (fails(call_map, descriptor)) return MAP_FAILED;
  return reinterpret_cast<void*>(
      syscall(SYS_mmap, at, size, protection, flags, descriptor, offset));
}

void* mmap64(void* at, size_t size, int protection, int flags, int descriptor, off64_t offset) {
  if (fails(call_map, descriptor)) return MAP_FAILED;
  return reinterpret_cast<void*>(
      syscall(SYS_mmap, at, size, protection, flags, descriptor, offset));
}

int rename(const char* from, const char* to) {
  if (fails(call_rename, AT_FDCWD, to)) return -1;
  return static_cast<int>(syscall(SYS_rename, from, to));
}

int renameat2(int from_folder, const char* from, int to_folder, const char* to, unsigned flags) {
  if (fails(call_rename, to_folder, to)) return -1;
  return static_cast<int>(syscall(SYS_renameat2, from_folder, from, to_folder, to, flags));
}

int link(const char* from, const char* to) {
  if (fails(call_link, AT_FDCWD, to)) return -1;
  return static_cast<int>(syscall(SYS_link, from, to));
}

int linkat(int from_folder, const char* from, int to_folder, const char* to, int flags) {
  if (fails(call_link, to_folder, to)) return -1;
  return static_cast<int>(syscall(SYS_linkat, from_folder, from, to_folder, to, flags));
}

int unlink(const char* path) {
  if (fails(call_unlink, AT_FDCWD, path)) return -1;
  return static_cast<int>(syscall(SYS_unlink, path));
}

int remove(const char* path) {  // What std::filesystem::remove() calls.
  static const auto real = next<int(const char*)>("remove");
  return fails(call_unlink, AT_FDCWD, path) ? -1 : real(path);
}

}  // extern "C"
// NOLINTEND
