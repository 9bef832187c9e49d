#include "worker/supervision/supervisor.hpp"

#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <new>

#include "coordinator/dispatch/state.hpp"
#include "core/error.hpp"
#include "proto/link/machine.hpp"
#include "tests/test.hpp"

namespace proofmass::worker {
namespace {

using Time = std::chrono::steady_clock::time_point;

TEST(RestartPolicy, WaitsTwiceAsLongAfterEachCrashUpToHalfAMinute) {
  RestartPolicy policy;
  std::vector<RestartConfig::Duration> delays;
  for (int i = 0; i < 9; ++i) delays.push_back(policy.on_crash(Time{} + i * 30s).value());
  EXPECT_EQ(delays,
            (std::vector<RestartConfig::Duration>{1s, 2s, 4s, 8s, 16s, 30s, 30s, 30s, 30s}));
}

// Later, and the crash counts against nobody; as long again is for the start and the network.
TEST(RestartPolicy, StartsAWorkerBeforeItsCoordinatorTakesItForLost) {
  EXPECT_LE(2 * RestartConfig{}.delay_max, coordinator::DispatchConfig{}.lost_after);
}

TEST(RestartPolicy, GivesUpAtTheTenthCrashWithinTenMinutes) {
  RestartPolicy policy;
  for (int i = 0; i < 9; ++i) EXPECT_TRUE(policy.on_crash(Time{} + i * 60s).has_value());
  EXPECT_FALSE(policy.on_crash(Time{} + 600s).has_value());
}

TEST(RestartPolicy, ForgetsOldCrashes) {
  RestartPolicy policy;
  for (int i = 0; i < 100; ++i) {
    EXPECT_TRUE(policy.on_crash(Time{} + i * 67s).has_value()) << "nine within ten minutes";
  }
  EXPECT_EQ(policy.on_crash(Time{} + 10h), 1s);
}

constexpr RestartConfig at_once{.delay = RestartConfig::Duration::zero(),
                                .delay_max = RestartConfig::Duration::zero(),
                                .num_crashes_max = 3};

/// What the processes of a test tell each other.
struct Board {
  std::atomic<int> num_starts = 0;
  std::atomic<std::uint64_t> registered_session = 0;
  std::atomic<std::uint64_t> former_session = 0;
  std::atomic<int> num_requests = 0;
  std::atomic<pid_t> child = 0;
};

class SupervisorTest : public testing::Test {
 protected:
  SupervisorTest()
      : board(*new (mmap(nullptr, sizeof(Board), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS,
                         -1, 0)) Board) {
    std::signal(SIGHUP, SIG_DFL);  // Whoever runs the tests may have it ignored.
  }
  ~SupervisorTest() override { munmap(&board, sizeof(Board)); }

  /// Supervises the work in a process of its own, whose exit code is returned: 99 if it throws.
  pid_t start_supervisor(const std::function<int(const ChildStart&)>& work,
                         const RestartConfig& config = at_once) {
    const pid_t supervisor = fork();
    if (supervisor != 0) return supervisor;
    int exit_code = 99;
    try {
      exit_code = supervise(
          work, [](const wire::Event&) {}, config);
    } catch (const Error& error) {
      std::fprintf(stderr, "%s\n", error.what());
    }
    _exit(exit_code);
  }
  static int exit_code_of(pid_t process) {
    int status = 0;
    waitpid(process, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  }
  int supervise_here(const std::function<int(const ChildStart&)>& work) {
    return exit_code_of(start_supervisor(work));
  }
  /// Notes what the child was told, and returns how many were started before it.
  int note(const ChildStart& start) {
    if (start.former) board.former_session = start.former->session();
    return board.num_starts++;
  }

  Board& board;
};

TEST_F(SupervisorTest, HandsOnTheExitCode) {
  EXPECT_EQ(supervise_here([&](const ChildStart& start) { return 7 + note(start); }), 7);
  EXPECT_EQ(board.num_starts, 1);
}

// Nothing says that memory was short: somebody killed it, and the runs have no part in that.
TEST_F(SupervisorTest, TellsOfAKillThatNobodyIsToBlameForIt) {
  const int exit_code = supervise_here([&](const ChildStart& start) {
    if (note(start) == 0) {
      start.note_registered();
      std::raise(SIGKILL);
    }
    return start.former->reason() == proto::LOSS_REASON_PREEMPTED ? 0 : 1;
  });
  EXPECT_EQ(exit_code, 0);
  EXPECT_EQ(board.num_starts, 2);
  EXPECT_NE(board.former_session, 0U);
}

// The second one ends before a coordinator is told of the first, whose runs it still waits for.
TEST_F(SupervisorTest, TellsOfTheLastSessionThatACoordinatorKnows) {
  const int exit_code = supervise_here([&](const ChildStart& start) {
    const int num_before = note(start);
    if (num_before == 0) {
      board.registered_session = start.session.value;
      start.note_registered();
    }
    if (num_before < 2) std::raise(SIGKILL);
    return 0;
  });
  EXPECT_EQ(exit_code, 0);
  EXPECT_EQ(board.num_starts, 3);
  EXPECT_EQ(board.former_session, board.registered_session);
}

TEST_F(SupervisorTest, GivesUpAWorkerThatCrashesTooOften) {
  testing::internal::CaptureStderr();
  const int exit_code = supervise_here([&](const ChildStart& start) -> int {
    (void)note(start);
    std::abort();
  });
  const std::string text = testing::internal::GetCapturedStderr();
  EXPECT_EQ(exit_code, 99);
  EXPECT_EQ(board.num_starts, 3);
  EXPECT_NE(text.find("crashes = 3 (must be fewer within 600 s); the last by signal=6 (Aborted)"),
            std::string::npos)
      << text;
}

/// Waits for requests, and ends with their number when the last one has come.
int count_requests(Board& board, int num_expected) {
  sigset_t set;
  sigemptyset(&set);
  sigaddset(&set, handed_on_signal());
  siginfo_t info{};
  board.child = getpid();
  while (info.si_value.sival_int < num_expected) {
    sigwaitinfo(&set, &info);
    board.num_requests = info.si_value.sival_int;
  }
  return 40 + info.si_value.sival_int;
}

void wait_until_stopped(const Board& board) {
  const auto state = [&] {
    std::ifstream file("/proc/" + std::to_string(board.child) + "/stat");
    std::string id, name, letter;
    file >> id >> name >> letter;
    return letter;
  };
  while (board.child == 0 || state() != "T") std::this_thread::yield();
}

// The child has SIGTERM and SIGINT blocked: to its process group they were sent, too.
TEST_F(SupervisorTest, HandsOnThatItIsAskedToEndAndHowOften) {
  const pid_t supervisor = start_supervisor([&](const ChildStart&) {
    std::raise(SIGTERM);
    return count_requests(board, 3);
  });
  while (board.child == 0) std::this_thread::yield();
  kill(supervisor, SIGTERM);
  while (board.num_requests == 0) std::this_thread::yield();
  kill(supervisor, SIGINT);
  while (board.num_requests == 1) std::this_thread::yield();
  kill(supervisor, SIGHUP);
  EXPECT_EQ(exit_code_of(supervisor), 43);
}

TEST(EndSignals, LeaveOutAHangupThatIsIgnored) {
  const auto before = std::signal(SIGHUP, SIG_IGN);
  EXPECT_THAT(end_signals(), testing::ElementsAre(SIGTERM, SIGINT));
  std::signal(SIGHUP, before);
}

// As the kernel may leave one that is forked while its group is stopped and continued.
TEST_F(SupervisorTest, ContinuesAStoppedWorkerWhenItIsContinued) {
  const pid_t supervisor = start_supervisor([&](const ChildStart&) {
    board.child = getpid();
    raise(SIGSTOP);
    return 7;
  });
  wait_until_stopped(board);
  kill(supervisor, SIGCONT);
  EXPECT_EQ(exit_code_of(supervisor), 7);
}

TEST_F(SupervisorTest, ContinuesAStoppedWorkerThatIsToEnd) {
  const pid_t supervisor = start_supervisor([&](const ChildStart&) {
    board.child = getpid();
    raise(SIGSTOP);
    return count_requests(board, 1);
  });
  wait_until_stopped(board);
  kill(supervisor, SIGTERM);
  EXPECT_EQ(exit_code_of(supervisor), 41);
}

TEST_F(SupervisorTest, DoesNotStartAWorkerAgainThatCrashesWhenAskedToEnd) {
  const pid_t supervisor = start_supervisor([&](const ChildStart& start) -> int {
    (void)note(start);
    (void)count_requests(board, 1);
    std::abort();
  });
  while (board.child == 0) std::this_thread::yield();
  kill(supervisor, SIGTERM);
  EXPECT_EQ(exit_code_of(supervisor), 128 + SIGABRT);
  EXPECT_EQ(board.num_starts, 1);
}

TEST_F(SupervisorTest, EndsWhenItIsAskedToWhileItWaitsToStartAgain) {
  const RestartConfig in_an_hour{.delay = std::chrono::hours(1),
                                 .delay_max = std::chrono::hours(1)};
  const pid_t supervisor = start_supervisor(
      [&](const ChildStart& start) -> int {
        (void)note(start);
        std::abort();
      },
      in_an_hour);
  while (board.num_starts == 0) std::this_thread::yield();
  kill(supervisor, SIGTERM);
  const int exit_code = exit_code_of(supervisor);
  // The request comes before or after the end of the child is known.
  EXPECT_TRUE(exit_code == 0 || exit_code == 128 + SIGABRT) << exit_code;
  EXPECT_EQ(board.num_starts, 1);
}

TEST_F(SupervisorTest, TakesTheWorkerWithItWhenItIsKilled) {
  int ends[2];
  ASSERT_EQ(pipe(ends), 0);
  const pid_t supervisor = start_supervisor([&](const ChildStart&) {
    sigset_t set;
    sigemptyset(&set);
    sigaddset(&set, SIGTERM);
    board.child = getpid();
    int signal = 0;
    sigwait(&set, &signal);
    const char answer = signal == SIGTERM ? 'T' : '?';
    return write(ends[1], &answer, 1) == 1 ? 0 : 1;
  });
  while (board.child == 0) std::this_thread::yield();
  kill(supervisor, SIGKILL);
  EXPECT_EQ(exit_code_of(supervisor), -SIGKILL);
  char answer = 0;
  EXPECT_EQ(read(ends[0], &answer, 1), 1);
  EXPECT_EQ(answer, 'T');
  close(ends[0]);
  close(ends[1]);
}

TEST(RandomSession, IsNeverTheSame) {
  EXPECT_NE(wire::random_number(), 0U);
  EXPECT_NE(wire::random_number(), wire::random_number());
}

}  // namespace

}  // namespace proofmass::worker
