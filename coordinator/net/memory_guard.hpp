#pragma once

#include <cstddef>
#include <functional>
#include <memory>

#include "coordinator/dispatch/outbox.hpp"

namespace proofmass::coordinator {

/// When the sockets of a process are to be closed for the memory that they hold. Bytes are those of
/// its resident memory.
class MemoryBound {
 public:
  /// @param size_max  Of the process, bytes. The sockets are closed from three quarters of it on,
  ///                  so that what arrives meanwhile finds room.
  explicit MemoryBound(std::size_t size_max) : alarm_size_(size_max / 4 * 3), limit_(alarm_size_) {}

  /// True if the sockets are to be closed at this size. Of a process that needs more for something
  /// else they are closed again only when it has grown by a further quarter.
  [[nodiscard]] bool is_exceeded(std::size_t size);

  /// @param size  After the sockets were closed and memory was given back.
  /// @return True if the process is still too large, and was not before.
  [[nodiscard]] bool note_reset(std::size_t size);

  [[nodiscard]] std::size_t limit() const { return limit_; }  ///< Beyond which it is exceeded.

 private:
  std::size_t alarm_size_;
  std::size_t limit_;
  bool is_high_ = false;
};

/// Resident memory of this process. Keeps a file open, so that it works when the process has no
/// descriptor left.
class ResidentMemory {
 public:
  ResidentMemory();  ///< @throws Error if the system does not tell.
  ~ResidentMemory();
  ResidentMemory(const ResidentMemory&) = delete;
  ResidentMemory& operator=(const ResidentMemory&) = delete;

  [[nodiscard]] std::size_t size() const;  ///< Bytes.

 private:
  int file_;
};

/// Looks at the memory of this process many times a second, in a thread of its own, so that it also
/// does while the service's thread is busy or waits for a disk.
class MemoryGuard {
 public:
  /// What a guard does to sockets, in its own thread.
  struct Actions {
    std::function<void()> close;  ///< Lets all go that the sockets hold; nothing comes in then.
    std::function<bool()> open;   ///< False if the addresses cannot be had now: called again.
    Log note;                     ///< `sockets_reset`, `memory_high`, `sockets_unbound`.
  };

  MemoryGuard(std::size_t size_max, Actions actions);
  ~MemoryGuard();  ///< Waits for the thread.
  MemoryGuard(const MemoryGuard&) = delete;
  MemoryGuard& operator=(const MemoryGuard&) = delete;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace proofmass::coordinator
