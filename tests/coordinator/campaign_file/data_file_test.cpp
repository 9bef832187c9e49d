#include "coordinator/campaign_file/data_file.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <string>

#include "core/definition/csv.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "tests/coordinator/campaign_file/scratch_folder.hpp"

namespace proofmass::coordinator::detail {
namespace {

using ::testing::ElementsAre;

const std::string headings =
    "time_s,linear_x_m_s2,linear_y_m_s2,linear_z_m_s2,"
    "angular_x_rad_s2,angular_y_rad_s2,angular_z_rad_s2\n";

std::string refusal_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(ParseEnvironment, ReadsEveryColumnOfEveryRow) {
  const EnvironmentTable table =
      parse_environment(headings + "0,1,2,3,4,5,6\r\n 100 , 1e-300,0.1,-3,4,5,6\n", "e.csv", 100.0);
  ASSERT_EQ(table.size(), 2u);
  EXPECT_EQ(table[0], (EnvironmentRow{0.0, {1, 2, 3}, {4, 5, 6}}));
  EXPECT_EQ(table[1], (EnvironmentRow{100.0, {1e-300, 0.1, -3}, {4, 5, 6}}));
}

TEST(ParseColumn, FindsItByItsHeading) {
  EXPECT_THAT(parse_column("run, x ,y\n0,1.5,a\n1,-2e-3,b\n", "t.csv", "x"),
              ElementsAre(1.5, -2e-3));
  EXPECT_THAT(parse_column("x\n1\n2", "t.csv", "x"), ElementsAre(1.0, 2.0));
}

TEST(ReadTextFile, TakesAFileOfExactlyTheLargestSizeAndNoLarger) {
  const test::ScratchFolder folder;
  const auto file = folder.write("f", "12345");
  EXPECT_EQ(read_text_file(file, 5, Pipes::refused), "12345");
  EXPECT_EQ(refusal_of([&] { (void)read_text_file(file, 4, Pipes::refused); }),
            "is larger than 4 bytes");
}

// Reading it waits for a message of the kernel; its size is 0.
TEST(ReadTextFile, ReadsNothingThatTheKernelMakesUp) {
  EXPECT_EQ(read_text_file("/proc/kmsg", 5, Pipes::accepted), "");
  EXPECT_EQ(read_text_file("/proc/uptime", 5, Pipes::refused), "");
}

TEST(ReadTextFile, TakesAPipeOnlyWhereAUserMayNameOne) {
  const test::ScratchFolder folder;
  const std::filesystem::path pipe = folder.path() / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_EQ(read_text_file(pipe, 5, Pipes::accepted), "");  // Nobody writes to it.
  const int keeper = ::open(pipe.c_str(), O_RDONLY | O_NONBLOCK);
  std::ofstream(pipe) << "12345";
  EXPECT_EQ(read_text_file(pipe, 5, Pipes::accepted), "12345");
  ::close(keeper);
  for (const std::filesystem::path& file : {pipe, std::filesystem::path("/dev/zero")}) {
    EXPECT_EQ(refusal_of([&] { (void)read_text_file(file, 5, Pipes::refused); }),
              "is a pipe, a socket or a device");
  }
  EXPECT_EQ(refusal_of([&] { (void)read_text_file("/dev/zero", 5, Pipes::accepted); }),
            "is larger than 5 bytes");
}

}  // namespace
}  // namespace proofmass::coordinator::detail
