#pragma once

#include <sys/types.h>

#include <cstdint>
#include <functional>
#include <string>

namespace proofmass::coordinator {

/// What the kernel lets a child process have.
struct ChildLimits {
  std::uint64_t memory_size_max = 0;  ///< Bytes of address space; not held under sanitizers.
  std::uint64_t compute_s_max = 0;    ///< Seconds of processor time.
};

/// A piece of work in a process of its own, which can be killed at any time. It ends with this
/// process, however that ends.
class ChildProcess {
 public:
  /// Begins the work, which gets the writing end of a pipe. The child ends when it returns, without
  /// destructors of the parent's objects.
  /// @pre This process has one thread.
  /// @throws Error if the process cannot be made.
  ChildProcess(const ChildLimits& limits, const std::function<void(int pipe)>& work);
  ~ChildProcess();  ///< Kills it.
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  /// The reading end of the pipe; it ends when the child does.
  [[nodiscard]] int pipe() const { return pipe_; }

  void signal(int number) const;

  /// Waits for the end. @returns What waitpid() says of it.
  [[nodiscard]] int wait();

 private:
  pid_t id_ = 0;
  int pipe_ = 0;
};

/// How a process ended, for people: `exit code 1`, `killed by signal 9 (Killed)`.
[[nodiscard]] std::string end_text(int status);

}  // namespace proofmass::coordinator
