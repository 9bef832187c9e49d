#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/link/whole_file.hpp"
#include "proto/model_program/described_model.hpp"

namespace proofmass::wire {

/// A model program that runs as a child of this process: it reads questions from its standard
/// input, a line each, and answers each with a line, in their order. What it prints as standard
/// error becomes that of this process, up to a limit. It does not outlive this process, however
/// that ends.
class ProgramProcess {
 public:
  /// @throws ModelProgramError if it cannot be started.
  ProgramProcess(const std::filesystem::path& program, const ProgramLimits& limits);
  /// Kills it, and what it has started.
  ~ProgramProcess();

  /// Asks all questions and passes each answer on, without its end of line. Questions and answers
  /// pass one another, so that neither side waits for the other with more than one of them.
  ///
  /// @param on_answer   What it throws leaves answers behind: the process is of no further use.
  /// @param on_silence  Called once if there is no answer for a twelfth of the time that it has.
  /// @throws ModelProgramError, after which the process is of no further use either.
  void ask(const std::vector<std::string>& questions,
           const std::function<void(std::string_view answer)>& on_answer,
           std::function<void()> on_silence = {});

  /// Puts its own limits in place of those that it was started with, for good.
  void limit(const ProgramLimits& limits);

 private:
  void write_some(std::string_view& text) const;
  void read_some();
  /// The first part of what it prints as standard error is passed on as it comes, and the last part
  /// in the end, with the number of bytes that are left out between them.
  void pass_on_errors();
  /// @param is_final  The hard limit, too, which nobody can raise again.
  void limit_memory(const ProgramLimits& limits, bool is_final) const;
  void expect_silence() const;
  [[nodiscard]] std::string how_it_ended();
  [[noreturn]] void fail(std::string_view reason) const;
  [[noreturn]] void fail_unasked(std::string_view text) const;

  std::string name_;
  std::chrono::seconds answer_time_max_{};
  pid_t process_id_ = 0;  // 0 once it has ended.
  Descriptor questions_;
  Descriptor answers_;
  Descriptor errors_;
  Descriptor lifeline_;
  std::string received_;  // Behind the last line that was taken.
  bool has_answered_ = false;
  std::size_t errors_size_ = 0;  // Of all that it printed as standard error.
  std::string last_errors_;      // Behind the first part.
};

}  // namespace proofmass::wire
