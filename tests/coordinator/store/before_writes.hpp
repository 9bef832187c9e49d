#pragma once

#include <sqlite3.h>
#include <unistd.h>

#include <cstddef>
#include <functional>
#include <utility>

namespace proofmass::test {

/// While it lives, something happens before each call by which SQLite writes to a file, in whatever
/// thread. Calls that the action itself leads to are left alone. There may be one at a time.
class BeforeWrites {
 public:
  explicit BeforeWrites(std::function<void()> action) {
    action_ = std::move(action);
    // Which of them SQLite uses depends on how it was built.
    replace("write", reinterpret_cast<sqlite3_syscall_ptr>(&act_and_write));
    replace("pwrite", reinterpret_cast<sqlite3_syscall_ptr>(&act_and_pwrite));
    replace("pwrite64", reinterpret_cast<sqlite3_syscall_ptr>(&act_and_pwrite));
  }
  ~BeforeWrites() {
    for (const char* const name : {"write", "pwrite", "pwrite64"}) replace(name, nullptr);
  }
  BeforeWrites(const BeforeWrites&) = delete;
  BeforeWrites& operator=(const BeforeWrites&) = delete;

 private:
  static void replace(const char* name, sqlite3_syscall_ptr function) {
    sqlite3_vfs* const system = sqlite3_vfs_find(nullptr);
    (void)system->xSetSystemCall(system, name, function);
  }
  static void act() {
    if (std::exchange(is_acting_, true)) return;
    action_();
    is_acting_ = false;
  }
  static ssize_t act_and_write(int descriptor, const void* bytes, std::size_t size) {
    act();
    return ::write(descriptor, bytes, size);
  }
  static ssize_t act_and_pwrite(int descriptor, const void* bytes, std::size_t size, off_t place) {
    act();
    return ::pwrite(descriptor, bytes, size, place);
  }

  static inline std::function<void()> action_;
  static inline bool is_acting_ = false;
};

}  // namespace proofmass::test
