#include "coordinator/store/detail/file_place.hpp"

#include <gmock/gmock.h>

#include <cerrno>

#include "tests/coordinator/store/store_fixture.hpp"

namespace proofmass::coordinator::detail {
namespace {

using test::store_error_of;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

using FileSystemTest = test::StoreTest;

// Types from statfs(2).
TEST(NetworkFileSystemName, KnowsThoseThatClustersUse) {
  EXPECT_EQ(network_file_system_name(0x6969), "NFS");
  EXPECT_EQ(network_file_system_name(0x517b), "SMB");
  EXPECT_EQ(network_file_system_name(0xfe534d42), "SMB2");
  EXPECT_EQ(network_file_system_name(0xff534d42), "CIFS");
  EXPECT_EQ(network_file_system_name(0x0bd00bd0), "Lustre");
  EXPECT_EQ(network_file_system_name(0x47504653), "GPFS");
  EXPECT_EQ(network_file_system_name(0x00c36400), "Ceph");
}

TEST(NetworkFileSystemName, IsEmptyForLocalOnes) {
  EXPECT_EQ(network_file_system_name(0xef53), "");      // ext2, ext3, ext4
  EXPECT_EQ(network_file_system_name(0x58465342), "");  // XFS
  EXPECT_EQ(network_file_system_name(0x9123683e), "");  // Btrfs
  EXPECT_EQ(network_file_system_name(0x01021994), "");  // tmpfs
  EXPECT_EQ(network_file_system_name(0x794c7630), "");  // overlayfs, as in containers
}

// Lines from proc(5), as the kernel writes them.
TEST(NetworkFuseName, IsReadFromTheMountTable) {
  const std::string_view table =
      "22 27 0:20 / /sys rw,nosuid - sysfs sysfs rw\n"
      "27 1 254:1 / / rw,relatime shared:1 - ext4 /dev/vda1 rw\n"
      "95 27 0:45 / /mnt/a\\040b rw,nosuid shared:7 master:2 - fuse.sshfs me@host:/data "
      "rw,user_id=0\n"
      "96 27 0:46 / /mnt/c rw - fuse.fuse-overlayfs fuse-overlayfs rw\n"
      "97 27 0:47 / /mnt/d rw - fuse.glusterfs host:/vol rw\n";
  EXPECT_EQ(network_fuse_name(table, "0:45"), "fuse.sshfs");
  EXPECT_EQ(network_fuse_name(table, "0:47"), "fuse.glusterfs");
  EXPECT_EQ(network_fuse_name(table, "0:46"), "");
  EXPECT_EQ(network_fuse_name(table, "0:4"), "");
  EXPECT_EQ(network_fuse_name(table, "254:1"), "");
  EXPECT_EQ(network_fuse_name("", "0:45"), "");
  EXPECT_EQ(network_fuse_name("95 27 0:45 / /mnt rw", "0:45"), "");
}

TEST_F(FileSystemTest, CheckPassesALocalDirectory) {
  check_directory_of(file());
  EXPECT_EQ(wire::synchronise_directory_of(file()), 0);
}

TEST_F(FileSystemTest, ReportsAMissingDirectory) {
  const std::string expected =
      "directory = " + (directory() / "missing").string() + " (No such file or directory)";
  EXPECT_EQ(test::store_error_of([&] { check_directory_of(directory() / "missing" / "a.db"); }),
            expected);
  EXPECT_EQ(wire::synchronise_directory_of(directory() / "missing" / "a.db"), ENOENT);
}

using StoreLockTest = test::StoreTest;

TEST_F(StoreLockTest, IsHeldByOne) {
  const StoreLock lock(file());
  EXPECT_THAT(store_error_of([&] { const StoreLock second(file()); }),
              HasSubstr("(held by process " + std::to_string(::getpid()) + " on "));
}

TEST_F(StoreLockTest, IsFreeAfterItsHolderAndLeavesNoFile) {
  { const StoreLock lock(file()); }
  EXPECT_TRUE(file_names().empty());
  const StoreLock lock(file());
  EXPECT_THAT(file_names(), ElementsAre("campaign.db.lock"));
}

TEST_F(StoreLockTest, IgnoresAFileThatACrashLeftBehind) {
  test::write_file(file().concat(".lock"), "process 1 on nowhere\n");
  const StoreLock lock(file());
  EXPECT_THAT(store_error_of([&] { const StoreLock second(file()); }),
              HasSubstr("held by process " + std::to_string(::getpid()) + " on "));
}

TEST_F(StoreLockTest, IsOneForAllNamesOfAFile) {
  test::write_file(file(), "");
  std::filesystem::create_symlink(file(), directory() / "alias.db");
  const StoreLock lock(file());
  EXPECT_NE(store_error_of([&] { const StoreLock second(directory() / "alias.db"); }), "");
}

TEST_F(StoreLockTest, NamesNobodyIfTheHolderLeftNoName) {
  const StoreLock lock(file());
  test::write_file(file().concat(".lock"), "");
  EXPECT_THAT(store_error_of([&] { const StoreLock second(file()); }),
              HasSubstr("(held by another process; "));
}

}  // namespace
}  // namespace proofmass::coordinator::detail
