#include "coordinator/net/private_endpoint.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "proto/wire/endpoint.hpp"
#include "tests/coordinator/cli/temporary_directory.hpp"

namespace proofmass::coordinator {
namespace {

TEST(PrivateEndpoint, LiesInADirectoryThatOnlyThisUserCanEnter) {
  const PrivateEndpoint endpoint;
  EXPECT_NO_THROW(wire::check_endpoint("bind", endpoint.address()));
  const std::filesystem::path socket = endpoint.address().substr(6);
  const auto permissions = std::filesystem::status(socket.parent_path()).permissions();
  EXPECT_EQ(permissions, std::filesystem::perms::owner_all);
}

TEST(PrivateEndpoint, LeavesNothingBehind) {
  std::filesystem::path directory;
  {
    const PrivateEndpoint endpoint;
    directory = std::filesystem::path(endpoint.address().substr(6)).parent_path();
    EXPECT_TRUE(std::filesystem::exists(directory));
  }
  EXPECT_FALSE(std::filesystem::exists(directory));
}

TEST(PrivateEndpoint, IsAnotherEachTime) {
  EXPECT_NE(PrivateEndpoint().address(), PrivateEndpoint().address());
}

/// Directories in a place of their own.
class StaleEndpoint : public testing::Test {
 protected:
  /// What a killed process leaves, or something that resembles it.
  [[nodiscard]] std::filesystem::path make(const std::string& name, mode_t mode = S_IRWXU) const {
    const std::filesystem::path path = directory / name;
    std::filesystem::create_directory(path);
    std::ofstream(path / "lock").flush();
    std::ofstream(path / "workers").flush();
    chmod(path.c_str(), mode);
    return path;
  }
  [[nodiscard]] bool is_left_by_removal(const std::filesystem::path& path) const {
    remove_stale_endpoints(directory / "");
    return std::filesystem::exists(path / "workers");
  }

  test::TemporaryDirectory directory;
};

TEST_F(StaleEndpoint, IsRemoved) {
  const std::filesystem::path path = make("proofmass-run-a1B2c3");
  EXPECT_FALSE(is_left_by_removal(path));
  EXPECT_FALSE(std::filesystem::exists(path));
}

TEST_F(StaleEndpoint, IsLeftWhileItsLockIsHeld) {
  const std::filesystem::path path = make("proofmass-run-a1B2c3");
  const int lock = open((path / "lock").c_str(), O_RDWR);
  ASSERT_EQ(flock(lock, LOCK_EX), 0);
  EXPECT_TRUE(is_left_by_removal(path));
  close(lock);
  EXPECT_FALSE(is_left_by_removal(path));
}

TEST_F(StaleEndpoint, IsNothingElse) {
  EXPECT_TRUE(is_left_by_removal(make("proofmass-run-a1B2c3d")));
  EXPECT_TRUE(is_left_by_removal(make("proofmass-new-a1B2c3")));
  EXPECT_TRUE(is_left_by_removal(make("other-run-a1B2c3")));
  EXPECT_TRUE(is_left_by_removal(make("proofmass-run-open00", 0755)));
  const std::filesystem::path without_lock = make("proofmass-run-nolock");
  std::filesystem::remove(without_lock / "lock");
  EXPECT_TRUE(is_left_by_removal(without_lock));
  const std::filesystem::path target = make("target");
  std::filesystem::create_directory_symlink(target, directory / "proofmass-run-linked");
  EXPECT_TRUE(is_left_by_removal(target));
  const std::filesystem::path link = make("proofmass-run-lock_l");
  std::filesystem::remove(link / "lock");
  std::filesystem::create_symlink(target / "lock", link / "lock");
  EXPECT_TRUE(is_left_by_removal(link));
}

TEST_F(StaleEndpoint, KeepsWhatSomebodyElsePutThere) {
  const std::filesystem::path path = make("proofmass-run-a1B2c3");
  std::ofstream(path / "notes") << "precious";
  remove_stale_endpoints(directory / "");
  EXPECT_TRUE(std::filesystem::exists(path / "notes"));
}

}  // namespace
}  // namespace proofmass::coordinator
