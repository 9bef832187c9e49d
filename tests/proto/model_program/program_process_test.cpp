#include "proto/model_program/program_process.hpp"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <thread>

#include "tests/proto/link/scratch_directory.hpp"
#include "tests/test.hpp"

namespace proofmass::wire {
namespace {

/// A pipe whose writing end is the standard error of what is started: it is at its end when the
/// last of them has ended.
class ErrorPipe {
 public:
  ErrorPipe() { EXPECT_EQ(pipe2(ends_.data(), O_CLOEXEC), 0); }
  ~ErrorPipe() { close(ends_[0]); }
  ErrorPipe(const ErrorPipe&) = delete;
  ErrorPipe& operator=(const ErrorPipe&) = delete;

  void use_as_standard_error() const { dup2(ends_[1], STDERR_FILENO); }
  void close_writing_end() { close(std::exchange(ends_[1], -1)); }
  /// The next character, 0 at the end; nothing if neither comes within a while.
  [[nodiscard]] std::optional<char> next() const {
    constexpr int ms_max = 20'000;
    pollfd end{ends_[0], POLLIN, 0};
    char letter = 0;
    if (poll(&end, 1, ms_max) == 1 && read(ends_[0], &letter, 1) >= 0) return letter;
    return std::nullopt;
  }

 private:
  std::array<int, 2> ends_{-1, -1};
};

class ProgramProcessTest : public testing::Test {
 protected:
  [[nodiscard]] std::filesystem::path program(const std::string& lines) const {
    test::write_text(directory_ / "program", "#!/bin/sh\n" + lines, 0755);
    return directory_ / "program";
  }

 private:
  const test::ScratchDirectory directory_;
};

// It starts another program, neither reads its input, and signals do not reach their group.
TEST_F(ProgramProcessTest, DoesNotOutliveAProcessThatIsKilled) {
  const std::filesystem::path hanging =
      program("sleep 1000 &\nprintf s >&2\nwhile :; do sleep 1000; done\n");
  ErrorPipe errors;
  const pid_t parent = fork();
  if (parent == 0) {
    errors.use_as_standard_error();
    const ProgramProcess process(hanging, {});
    (void)!write(STDERR_FILENO, "p", 1);
    pause();
  }
  errors.close_writing_end();
  const std::set<std::optional<char>> are_there{errors.next(), errors.next()};
  ASSERT_THAT(are_there, testing::UnorderedElementsAre('p', 's'));
  kill(parent, SIGKILL);
  waitpid(parent, nullptr, 0);

  EXPECT_EQ(errors.next(), '\0');
}

// Threads hand programs on to one another.
TEST_F(ProgramProcessTest, OutlivesTheThreadThatStartedIt) {
  const std::filesystem::path echo = program("cat\n");
  std::unique_ptr<ProgramProcess> process;
  std::thread([&] { process = std::make_unique<ProgramProcess>(echo, ProgramLimits{}); }).join();
  const std::string question = "still there?";
  std::string answered;

  process->ask({question}, [&](std::string_view answer) { answered = answer; });

  EXPECT_EQ(answered, question);
}

}  // namespace
}  // namespace proofmass::wire
