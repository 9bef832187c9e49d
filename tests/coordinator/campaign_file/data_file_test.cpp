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

std::string environment_refusal(const std::string& text) {
  return refusal_of([&] { (void)parse_environment(text, "e.csv", 100.0); });
}

std::string column_refusal(const std::string& text, const std::string& heading = "x") {
  return refusal_of([&] { (void)parse_column(text, "t.csv", heading); });
}

TEST(ParseEnvironment, ReadsEveryColumnOfEveryRow) {
  const EnvironmentTable table =
      parse_environment(headings + "0,1,2,3,4,5,6\r\n 100 , 1e-300,0.1,-3,4,5,6\n", "e.csv", 100.0);
  ASSERT_EQ(table.size(), 2u);
  EXPECT_EQ(table[0], (EnvironmentRow{0.0, {1, 2, 3}, {4, 5, 6}}));
  EXPECT_EQ(table[1], (EnvironmentRow{100.0, {1e-300, 0.1, -3}, {4, 5, 6}}));
}

TEST(ParseEnvironment, RefusesOtherHeadings) {
  const std::string rule =
      "the first line must be time_s,linear_x_m_s2,linear_y_m_s2,linear_z_m_s2,"
      "angular_x_rad_s2,angular_y_rad_s2,angular_z_rad_s2";
  EXPECT_EQ(environment_refusal(""), "e.csv:1: " + rule);
  EXPECT_EQ(environment_refusal("0,1,2,3,4,5,6\n"), "e.csv:1: column 1 is \"0\"; " + rule);
  EXPECT_EQ(environment_refusal("time_s,linear_x_m_s2\n"), "e.csv:1: column 3 is missing; " + rule);
}

TEST(ParseEnvironment, RefusesAMalformedRowByLine) {
  EXPECT_EQ(environment_refusal(headings + "0,1,2,3,4,5\n"), "e.csv:2: 6 cells (must be 7)");
  EXPECT_EQ(environment_refusal(headings + "0,1,2,3,4,5,6\n\n100,1,2,3,4,5,6\n"),
            "e.csv:3: 1 cells (must be 7)");
  EXPECT_EQ(environment_refusal(headings + "0,1,2,3,4,5,6\n9,1,x,3,4,5,6\n"),
            "e.csv:3: linear_y_m_s2 = \"x\" (must be a number)");
  EXPECT_EQ(environment_refusal(headings + "0,1,2,3,4,5,6 7\n"),
            "e.csv:2: angular_z_rad_s2 = \"6 7\" (must be a number)");
  EXPECT_EQ(environment_refusal(headings + "0,,2,3,4,5,6\n"),
            "e.csv:2: linear_x_m_s2 = \"\" (must be a number)");
  EXPECT_EQ(environment_refusal(headings + "0,1,2,nan,4,5,6\n"),
            "e.csv:2: linear_z_m_s2 = nan (must be finite)");
  EXPECT_EQ(environment_refusal(headings + "0,1e999,2,3,4,5,6\n"),
            "e.csv:2: linear_x_m_s2 = \"1e999\" (must be a number)");
}

TEST(ParseEnvironment, RefusesABrokenTimeAxisByLine) {
  const std::string row = ",1,2,3,4,5,6\n";
  EXPECT_EQ(environment_refusal(headings + "0" + row + "50" + row + "50" + row),
            "e.csv:4: environment.file row 3 = 50 (time_s must be > 50, that of the row before)");
  EXPECT_EQ(environment_refusal(headings + "1" + row + "200" + row),
            "e.csv:2: environment.file row 1 = 1 (the first time_s must be <= 0)");
  EXPECT_EQ(environment_refusal(headings + "0" + row + "99" + row),
            "e.csv:3: environment.file row 2 = 99 (the last time_s must be >= one orbit, 100 s)");
  EXPECT_EQ(environment_refusal(headings + "0" + row),
            "e.csv:1: environment.file = 1 rows (must have 2 to 200000)");
}

TEST(ParseEnvironment, RefusesTooManyRows) {
  std::string text = headings;
  for (std::size_t i = 0; i <= environment_rows_max; ++i)
    text += std::to_string(i) + ",1,2,3,4,5,6\n";
  EXPECT_EQ(environment_refusal(text), "e.csv:200002: more than 200000 rows");
}

TEST(ParseColumn, FindsItByItsHeading) {
  EXPECT_THAT(parse_column("run, x ,y\n0,1.5,a\n1,-2e-3,b\n", "t.csv", "x"),
              ElementsAre(1.5, -2e-3));
  EXPECT_THAT(parse_column("x\n1\n2", "t.csv", "x"), ElementsAre(1.0, 2.0));
}

TEST(ParseColumn, RefusesAMissingOrDoubtfulHeading) {
  EXPECT_EQ(column_refusal(""),
            "t.csv:1: the file is empty; its first line must hold the headings");
  EXPECT_EQ(column_refusal("delta_x,b\n1,2\n", "detla_x"),
            "t.csv:1: no column \"detla_x\"; nearest is \"delta_x\"");
  EXPECT_EQ(column_refusal("something\n1\n"), "t.csv:1: no column \"x\"");
  EXPECT_EQ(column_refusal("x,x\n1,2\n"), "t.csv:1: two columns \"x\"");
}

TEST(ParseColumn, RefusesAMalformedRowByLine) {
  EXPECT_EQ(column_refusal("x,y\n1,2\n1\n"), "t.csv:3: 1 cells (must be 2)");
  EXPECT_EQ(column_refusal("x\n1\ntwo\n"), "t.csv:3: x = \"two\" (must be a number)");
  EXPECT_EQ(column_refusal("x\ninf\n"), "t.csv:2: x = inf (must be finite)");
}

TEST(ReadTextFile, TakesAFileOfExactlyTheLargestSizeAndNoLarger) {
  const test::ScratchFolder folder;
  const auto file = folder.write("f", "12345");
  EXPECT_EQ(read_text_file(file, 5, Pipes::refused), "12345");
  EXPECT_EQ(refusal_of([&] { (void)read_text_file(file, 4, Pipes::refused); }),
            "is larger than 4 bytes");
}

TEST(ReadTextFile, SaysWhyAFileCannotBeRead) {
  const test::ScratchFolder folder;
  EXPECT_EQ(refusal_of([&] { (void)read_text_file(folder.path() / "absent", 5, Pipes::accepted); }),
            "cannot be read: No such file or directory");
  EXPECT_EQ(refusal_of([&] { (void)read_text_file(folder.path(), 5, Pipes::accepted); }),
            "is a directory");
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
