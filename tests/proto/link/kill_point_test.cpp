#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <functional>
#include <set>
#include <string>

#include "tests/support/faults/planned_faults.hpp"

namespace proofmass::wire {
namespace {

// Exit code or, negative, the signal that a child ended with.
int ending_of(const std::function<void()>& work) {
  const pid_t child = ::fork();
  if (child == 0) {
    work();
    ::_exit(7);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  return WIFSIGNALED(status) ? -WTERMSIG(status) : WEXITSTATUS(status);
}

void pass(KillPoint point, int count) {
  for (int i = 0; i < count; ++i) kill_point(point);
}

TEST(KillPoint, KillsAtThePassageThatIsArmed) {
  EXPECT_EQ(ending_of([] {
              arm_kill_point(KillPoint::after_commit, 3);
              pass(KillPoint::after_commit, 2);
            }),
            7);
  EXPECT_EQ(ending_of([] {
              arm_kill_point(KillPoint::after_commit, 3);
              pass(KillPoint::after_commit, 3);
            }),
            -SIGKILL);
}

TEST(KillPoint, OtherPlacesDoNotCount) {
  EXPECT_EQ(ending_of([] {
              arm_kill_point(KillPoint::after_commit, 1);
              pass(KillPoint::before_commit, 5);
            }),
            7);
}

TEST(KillPoint, NothingHappensWithoutAPlan) {
  EXPECT_EQ(ending_of([] { pass(KillPoint::after_receive, 1000); }), 7);
}

TEST(KillPoint, NamesAreDistinctAndUnderstood) {
  std::set<std::string_view> names;
  for (int i = 0; i < num_kill_points; ++i) {
    const auto point = static_cast<KillPoint>(i);
    EXPECT_EQ(kill_point_from(to_text(point)), point);
    names.insert(to_text(point));
  }
  EXPECT_EQ(names.size(), std::size_t{num_kill_points});
  EXPECT_EQ(to_text(KillPoint::before_bye), "before_bye");
  EXPECT_EQ(to_text(KillPoint::while_migrating), "while_migrating");
  EXPECT_FALSE(kill_point_from("after_lunch"));
}

}  // namespace
}  // namespace proofmass::wire
