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

TEST(ReadTextFile, TakesAFileOfExactlyTheLargestSizeAndNoLarger) {
  const test::ScratchFolder folder;
  const auto file = folder.write("f", "12345");
  EXPECT_EQ(read_text_file(file, 5, Pipes::refused), "12345");
  EXPECT_EQ(refusal_of([&] { (void)read_text_file(file, 4, Pipes::refused); }),
            "is larger than 4 bytes");
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
