#include <gmock/gmock.h>
#include <signal.h>
#include <unistd.h>

#include <array>
#include <string>

#include "coordinator/archive/export.hpp"
#include "tests/coordinator/archive/archive_fixture.hpp"

namespace proofmass::coordinator {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using TextOutputFile = test::StoreTest;

TEST_F(TextOutputFile, AppearsWhenItIsComplete) {
  const std::string large(1 << 20, 'x');  // More than is kept in memory.
  TextOutput output(directory() / "a.csv");
  output.write(large);
  output.write("end");
  EXPECT_THAT(file_names(), ElementsAre("a.csv." + std::to_string(::getpid()) + ".new"));
  output.finish();
  EXPECT_THAT(file_names(), ElementsAre("a.csv"));
  EXPECT_EQ(test::content_of(directory() / "a.csv"), large + "end");
}

TEST_F(TextOutputFile, DoesNotAppearUnlessItIsFinished) {
  { TextOutput(directory() / "a.csv").write("half"); }
  EXPECT_THAT(file_names(), IsEmpty());
}

TEST_F(TextOutputFile, LeavesTheOldOneUntilTheNewOneIsComplete) {
  test::write_file(directory() / "a.csv", "old");
  { TextOutput(directory() / "a.csv").write("half"); }
  EXPECT_EQ(test::content_of(directory() / "a.csv"), "old");
  TextOutput output(directory() / "a.csv");
  output.write("new");
  output.finish();
  EXPECT_EQ(test::content_of(directory() / "a.csv"), "new");
}

// Nor what another program of ours is writing to the same name.
TEST_F(TextOutputFile, LeavesSomebodysFileOfALikeName) {
  test::write_file(directory() / "a.csv.new", "somebody's");
  TextOutput output(directory() / "a.csv");
  output.write("text");
  output.finish();
  EXPECT_EQ(test::content_of(directory() / "a.csv.new"), "somebody's");
}

TEST_F(TextOutputFile, NeedsADirectory) {
  const std::string path = (directory() / "no" / "a.csv").string();
  EXPECT_EQ(test::error_of([&] { const TextOutput output(path); }),
            "output = " + path + " (cannot be written: No such file or directory)");
}

TEST_F(TextOutputFile, SaysWhyItCannotBeWritten) {
  const std::string path = (directory() / "a.csv").string();
  const test::FileSizeLimit limit(1000);
  EXPECT_EQ(test::error_of([&] {
              TextOutput output(path);
              output.write(std::string(2000, 'x'));
              output.finish();
            }),
            "output = " + path + " (cannot be written: File too large)");
  EXPECT_THAT(file_names(), IsEmpty());
}

TEST_F(TextOutputFile, SaysWhyItCannotGetItsName) {
  const std::string path = (directory() / "a").string();
  std::filesystem::create_directories(directory() / "a" / "b");
  EXPECT_EQ(test::error_of([&] { TextOutput(path).finish(); }),
            "output = " + path + " (cannot be written: Is a directory)");
}

TEST(TextOutput, SaysThatItsReaderIsGone) {
  std::array<int, 2> pipe{};
  ASSERT_EQ(::pipe(pipe.data()), 0);
  ::close(pipe[0]);
  ::signal(SIGPIPE, SIG_IGN);
  const int standard_output = ::dup(1);
  ::dup2(pipe[1], 1);
  const std::string error = test::error_of([] {
    TextOutput output;
    output.write("text");
    output.finish();
  });
  ::dup2(standard_output, 1);
  ::close(standard_output);
  ::close(pipe[1]);
  ::signal(SIGPIPE, SIG_DFL);
  EXPECT_EQ(error, "output = - (cannot be written: Broken pipe)");
}

}  // namespace
}  // namespace proofmass::coordinator
