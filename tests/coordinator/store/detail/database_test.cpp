#include "coordinator/store/detail/database.hpp"

#include <cerrno>

#include "coordinator/store/detail/file_place.hpp"
#include "coordinator/store/detail/schema.hpp"
#include "core/microscope/results/health.hpp"
#include "tests/coordinator/store/store_fixture.hpp"
#include "tests/support/microscope_results.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator::detail {
namespace {

class DatabaseTest : public test::StoreTest {
 protected:
  DatabaseTest() : database_(file(), Access::create) {
    database_.execute("CREATE TABLE t (x INTEGER UNIQUE, y TEXT) STRICT");
  }
  [[nodiscard]] std::string message(const std::string& reason) const {
    return "campaign database = " + file().string() + " (" + reason + ")";
  }
  Database database_;
};

using DatabaseDeathTest = DatabaseTest;

TEST_F(DatabaseTest, BindsAndReadsEveryType) {
  Statement select = database_.prepare("SELECT ?, ?, ?, ?, ?, ? IS NULL");
  select.bind_all(std::numeric_limits<std::int64_t>::min(), std::uint64_t{1} << 62,
                  std::numeric_limits<std::uint32_t>::max(), 0.1, std::string_view("a\0b", 3),
                  std::optional<double>());
  ASSERT_TRUE(select.step());
  EXPECT_EQ(select.integer(0), std::numeric_limits<std::int64_t>::min());
  EXPECT_EQ(select.count(1), std::uint64_t{1} << 62);
  EXPECT_EQ(select.count(2), 4294967295u);
  EXPECT_EQ(select.real(3), 0.1);
  EXPECT_EQ(select.text(4), std::string("a\0b", 3));
  EXPECT_EQ(select.integer(5), 1);
  EXPECT_FALSE(select.step());
}

TEST_F(DatabaseTest, RollsBackATransactionThatIsNotCommitted) {
  {
    const Transaction transaction(database_);
    database_.execute("INSERT INTO t VALUES (1, '')");
  }
  EXPECT_EQ(database_.integer("SELECT count(*) FROM t"), 0);
  EXPECT_FALSE(database_.in_transaction());
}

TEST_F(DatabaseTest, ReportsALockOfAnotherProgram) {
  Database other(file(), Access::read_write);
  other.execute("PRAGMA busy_timeout = 0");
  const Transaction transaction(database_);
  EXPECT_EQ(store_error_of([&] { const Transaction second(other); }),
            message("is locked by another program for more than 5 s"));
}

TEST_F(DatabaseTest, ReportsWhatSqliteSaysOfAnythingElse) {
  EXPECT_EQ(store_error_of([&] { (void)database_.prepare("SELECT z FROM t"); }),
            message("no such column: z"));
  Statement insert = database_.prepare("INSERT INTO t VALUES (?, '')");
  insert.run(std::int64_t{5});
  EXPECT_EQ(store_error_of([&] { insert.run(std::int64_t{5}); }),
            message("UNIQUE constraint failed: t.x"));
  insert.run(std::int64_t{6});  // The statement is reset and works on.
  EXPECT_EQ(database_.integer("SELECT count(*) FROM t"), 2);
}

TEST_F(DatabaseTest, ReportsWhyAFileCannotBeOpened) {
  const std::filesystem::path missing = directory() / "missing" / "campaign.db";
  EXPECT_EQ(store_error_of([&] { Database(missing, Access::create); }),
            "campaign database = " + missing.string() +
                " (unable to open database file: No such file or directory)");
}

// SQLite keeps room for `-journal` in 512 bytes.
TEST_F(DatabaseTest, SaysThatAPathIsTooLong) {
  std::filesystem::path path = directory();
  constexpr std::size_t size_max = 504;
  while (path.native().size() + 200 < size_max) path /= std::string(150, 'd');
  std::filesystem::create_directories(path);
  path /= std::string(size_max - path.native().size() - 1, 'f');
  ASSERT_EQ(path.native().size(), size_max);
  Database(path, Access::create).execute("CREATE TABLE t (x)");
  EXPECT_NO_THROW(Database(path, Access::read_only));
  const std::filesystem::path longer = path.native() + "f";
  std::filesystem::rename(path, longer);
  const std::filesystem::path link = directory() / "link";
  std::filesystem::create_symlink(longer, link);
  for (const Access access :
       {Access::create, Access::read_write, Access::read_only, Access::immutable}) {
    for (const std::filesystem::path& name : {longer, link}) {
      EXPECT_EQ(store_error_of([&] { Database(name, access); }),
                "campaign database = " + name.string() +
                    " (has a path of 505 bytes, and SQLite opens none of more than 504: use "
                    "directories with shorter names)");
    }
  }
}

TEST_F(DatabaseTest, IsAFileWhateverItsName) {
  const std::filesystem::path before = std::filesystem::current_path();
  std::filesystem::current_path(directory());
  Database(":memory:", Access::create).execute("CREATE TABLE t (x)");
  std::filesystem::current_path(before);
  EXPECT_TRUE(std::filesystem::exists(directory() / ":memory:"));
}

TEST_F(DatabaseDeathTest, RefusesANumberThatSqliteCannotHold) {
  Statement select = database_.prepare("SELECT ?");
  EXPECT_THROW(select.bind_all(std::numeric_limits<double>::quiet_NaN()), StoreError);
  EXPECT_THROW(select.bind_all(std::numeric_limits<double>::infinity()), StoreError);
  EXPECT_THROW(select.bind_all(std::uint64_t{1} << 63), StoreError);
}

using SchemaTest = test::StoreTest;

TEST_F(SchemaTest, HasStrictTablesOnly) {
  Database database(file(), Access::create);
  database.execute(migrations(model(), test::schema())[0]);
  EXPECT_EQ(database.integer("SELECT count(*) FROM pragma_table_list WHERE type = 'table' AND NOT "
                             "strict AND name NOT LIKE 'sqlite%'"),
            0);
}

// Each row is refused by one rule: a result must have what its status says, and no more.
TEST_F(SchemaTest, TiesEveryNumberToTheStatus) {
  Store::create(file(), test::campaign_of(10), "").commit(test::deliveries_of(0, 1));
  Database database(file(), Access::read_write);
  for (const test::ParameterInfo& info : test::parameter_infos()) {
    const std::string name = std::string(info.name) + std::string(info.unit_suffix);
    for (const std::string kind : {"truth_", "estimate_"}) {
      const std::string column = kind + name;
      EXPECT_EQ(test::store_error_of(
                    [&] { database.execute("UPDATE run_result SET " + column + " = NULL"); }),
                "campaign database = " + file().string() + " (CHECK constraint failed: (" + column +
                    " IS NULL) = (status " + (kind == "truth_" ? "= 4))" : "> 2))"));
    }
  }
  EXPECT_NE(test::store_error_of([&] { database.execute("UPDATE run_result SET status = 3"); }),
            "");
  EXPECT_NE(test::store_error_of([&] { database.execute("UPDATE run_result SET status = 5"); }),
            "");
}

using FileSystemTest = test::StoreTest;

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

using StoreLockTest = test::StoreTest;

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
