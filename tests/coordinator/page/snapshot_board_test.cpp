#include "coordinator/page/page.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

class SnapshotBoardTest : public ::testing::Test {
 protected:
  void turn() {
    board.on_turn(now, [this] {
      ++num_taken;
      return ServiceSnapshot{};
    });
  }
  auto want() { return board.want(now); }

  TimePoint now{1000s};
  SnapshotBoard board{now};
  int num_taken = 0;
};

TEST_F(SnapshotBoardTest, CostsNothingWhileNobodyAsks) {
  for (int i = 0; i < 100; ++i) {
    now += 100ms;
    turn();
  }
  EXPECT_EQ(num_taken, 0);
}

TEST_F(SnapshotBoardTest, HasASnapshotAfterTheNextTurn) {
  EXPECT_EQ(want(), nullptr);
  turn();
  const auto snapshot = want();
  ASSERT_NE(snapshot, nullptr);
  EXPECT_EQ(snapshot->taken_at, now);
}

TEST_F(SnapshotBoardTest, TakesOneASecondForHalfAMinute) {
  (void)want();
  for (int i = 0; i < 600; ++i) {
    turn();
    now += 100ms;
  }
  EXPECT_EQ(num_taken, 30);
}

TEST_F(SnapshotBoardTest, TellsHowLongTheServiceHasNotComeRound) {
  now += 3s;
  EXPECT_EQ(board.since_turn(now), 3s);
  turn();
  now += 1s;
  EXPECT_EQ(board.since_turn(now), 1s);
}

}  // namespace
}  // namespace proofmass::coordinator
