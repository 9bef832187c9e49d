#pragma once

#include <sys/types.h>

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace proofmass::test {

/// A program that runs in a directory, its output in the files NAME.out and NAME.err there. In a
/// process group of its own, which is killed with this object.
class Process {
 public:
  Process(const std::filesystem::path& directory, const std::string& name,
          const std::string& program, const std::vector<std::string>& arguments);
  ~Process();
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  [[nodiscard]] pid_t id() const { return id_; }
  void signal(int number) const;
  /// As from a terminal: to the program and all that it started.
  void signal_all(int number) const;
  /// Its exit code, or minus the signal that ended it. @throws std::runtime_error if it does not
  /// end within two minutes.
  [[nodiscard]] int wait();

  [[nodiscard]] bool has_ended();  ///< Does not wait.

  /// Processes whose parent it is.
  [[nodiscard]] std::vector<pid_t> children() const;

 private:
  pid_t id_ = 0;
  int status_ = 0;
  bool has_ended_ = false;
};

/// True if the process exists and is no zombie.
[[nodiscard]] bool is_alive(pid_t id);

/// Waits until the condition holds, looking again every few milliseconds.
/// @throws std::runtime_error naming what was waited for if that takes more than two minutes.
void wait_until(const std::string& what, const std::function<bool()>& condition);

[[nodiscard]] std::string read_file(const std::filesystem::path& file);

}  // namespace proofmass::test
