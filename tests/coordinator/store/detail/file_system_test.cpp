#include "coordinator/store/detail/file_system.hpp"

#include <gmock/gmock.h>

#include "tests/coordinator/store/store_fixture.hpp"

namespace proofmass::coordinator::detail {
namespace {

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

TEST_F(FileSystemTest, CheckPassesALocalDirectory) {
  check_directory_of(file());
  synchronise_directory_of(file());
}

TEST_F(FileSystemTest, ReportsAMissingDirectory) {
  const std::string expected =
      "directory = " + (directory() / "missing").string() + " (No such file or directory)";
  EXPECT_EQ(test::store_error_of([&] { check_directory_of(directory() / "missing" / "a.db"); }),
            expected);
  EXPECT_EQ(
      test::store_error_of([&] { synchronise_directory_of(directory() / "missing" / "a.db"); }),
      expected);
}

}  // namespace
}  // namespace proofmass::coordinator::detail
