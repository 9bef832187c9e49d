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

using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::StartsWith;
using ::testing::ThrowsMessage;

constexpr int inherited = 9;  // A descriptor that programs have of whoever starts them.

/// A pipe whose writing end is a descriptor of what is started: it is at its end when the last of
/// them has ended.
class SignOfLife {
 public:
  SignOfLife() { EXPECT_EQ(pipe2(ends_.data(), O_CLOEXEC), 0); }
  ~SignOfLife() { close(ends_[0]); }
  SignOfLife(const SignOfLife&) = delete;
  SignOfLife& operator=(const SignOfLife&) = delete;

  void hand_down() const { dup2(ends_[1], inherited); }
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
    test::write_text(program_file(), "#!/bin/sh\n" + lines, 0755);
    return program_file();
  }
  [[nodiscard]] std::filesystem::path program_file() const { return directory_ / "program"; }

 private:
  const test::ScratchDirectory directory_;
};

// It starts another program, neither reads its input, and signals do not reach their group.
TEST_F(ProgramProcessTest, DoesNotOutliveAProcessThatIsKilled) {
  const std::filesystem::path hanging =
      program("sleep 1000 &\nprintf s >&9\nwhile :; do sleep 1000; done\n");
  SignOfLife sign;
  const pid_t parent = fork();
  if (parent == 0) {
    sign.hand_down();
    const ProgramProcess process(hanging, {});
    (void)!write(inherited, "p", 1);
    pause();
  }
  sign.close_writing_end();
  const std::set<std::optional<char>> are_there{sign.next(), sign.next()};
  ASSERT_THAT(are_there, testing::UnorderedElementsAre('p', 's'));
  kill(parent, SIGKILL);
  waitpid(parent, nullptr, 0);

  EXPECT_EQ(sign.next(), '\0');
}

// Some 400 kB in lines of 8 bytes, half of it before its only answer.
TEST_F(ProgramProcessTest, PassesOnTheFirstAndTheLastOfWhatAProgramPrints) {
  const std::filesystem::path chatty = program(
      "seq 1000000 1024999 >&2\nread -r question\nseq 1025000 1049999 >&2\necho\nexec sleep "
      "1000\n");
  testing::internal::CaptureStderr();

  {
    ProgramProcess process(chatty, {});
    process.ask({"?"}, [](std::string_view) {});
  }

  const std::string printed = testing::internal::GetCapturedStderr();
  EXPECT_THAT(printed, StartsWith("1000000\n1000001\n"));
  EXPECT_THAT(printed, HasSubstr("\n1008191\n\n/"));  // 65,536 bytes are 8,192 lines.
  EXPECT_THAT(
      printed,
      HasSubstr("/program: 330368 bytes of its standard error are left out here\n1049488\n"));
  EXPECT_THAT(printed, EndsWith("\n1049998\n1049999\n"));
}

// A program that is asked a thing may buffer its answer, as C does on a pipe, or just be slow.
TEST_F(ProgramProcessTest, TellsOfSilenceAndWhatItMayBe) {
  ProgramProcess slow(program("while [ ! -e \"$0\".go ]; do sleep 0.01; done\nread -r question\n"
                              "echo there\nexec sleep 1000\n"),
                      {.answer_time_max_s = 12});
  std::string answered;
  slow.ask(
      {"?"}, [&](std::string_view answer) { answered = answer; },
      [&] { test::write_text(program_file().string() + ".go", "", 0644); });
  EXPECT_EQ(answered, "there");
  const auto fails_with = [](const std::string& what) {
    return ThrowsMessage<ModelProgramError>(EndsWith("(no answer within 1 s" + what + ")"));
  };
  slow.limit({.answer_time_max_s = 1});
  EXPECT_THAT([&] { slow.ask({"?"}, [](std::string_view) {}); }, fails_with(""));

  ProgramProcess silent(program("exec sleep 1000\n"), {.answer_time_max_s = 1});

  EXPECT_THAT([&] { silent.ask({"?"}, [](std::string_view) {}); },
              fails_with("; it must flush each answer"));
}

TEST_F(ProgramProcessTest, SaysWhatAScriptThatCannotBeStartedLacks) {
  test::write_text(program_file(), "print('hello')\n", 0755);
  EXPECT_THAT([&] { const ProgramProcess process(program_file(), {}); },
              ThrowsMessage<ModelProgramError>(
                  EndsWith("Exec format error; a script begins with #! and what runs it")));
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
