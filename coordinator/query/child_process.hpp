#pragma once

#include <sys/types.h>

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>
#include <string_view>
#include <thread>

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

/// What a child process that runs a query tells its parent, in parts of text.
enum class PartKind : std::uint8_t {
  rows = 1,     ///< Whole rows.
  complete,     ///< The query has ended.
  interrupted,  ///< It was interrupted.
  query_error,  ///< One of the exceptions of run_query(); the text is its message.
  time_error,
  store_error,
  argument_error,
  other_error,
};

/// Most bytes of one part.
inline constexpr std::size_t part_size_max = std::size_t{1} << 30;

/// The child's end: writes parts to a pipe, many at a time and each after 20 ms at the latest, even
/// if the thread that adds them is busy.
class PartWriter {
 public:
  explicit PartWriter(int pipe);
  ~PartWriter();  ///< Writes what is left.
  PartWriter(const PartWriter&) = delete;
  PartWriter& operator=(const PartWriter&) = delete;

  /// @throws Error if the text is too long.
  void add(PartKind kind, std::string_view text);

 private:
  void write_late();
  void write_all();

  int pipe_;
  std::mutex mutex_;  ///< Guards what follows.
  std::condition_variable changed_;
  std::string buffer_;
  bool is_ending_ = false;
  std::thread thread_;  ///< Begins when all else is there.
};

/// The parent's end: takes bytes as they come and hands on whole parts.
class PartReader {
 public:
  using Visit = std::function<void(PartKind kind, std::string_view text)>;

  /// @throws Error if the bytes are no parts.
  void read(std::string_view bytes, const Visit& visit);

 private:
  std::string buffer_;
};

}  // namespace proofmass::coordinator
