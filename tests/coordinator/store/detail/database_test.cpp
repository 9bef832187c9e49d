#include "coordinator/store/detail/database.hpp"

#include <gmock/gmock.h>

#include <limits>

#include "tests/coordinator/store/store_fixture.hpp"

namespace proofmass::coordinator::detail {
namespace {

using test::store_error_of;

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

TEST_F(DatabaseTest, ReportsAFullDiskAndKeepsWhatWasCommitted) {
  database_.execute("INSERT INTO t VALUES (1, '')");
  database_.execute("PRAGMA max_page_count = 10");
  Transaction transaction(database_);
  Statement insert = database_.prepare("INSERT INTO t VALUES (?, ?)");
  EXPECT_EQ(
      store_error_of([&] { insert.run(std::int64_t{2}, std::string(100'000, 'x')); }),
      message("the disk is full; what was committed before is safe, free space and try again"));
  EXPECT_EQ(database_.integer("SELECT count(*) FROM t"), 1);
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
  EXPECT_THROW(select.bind(1, std::numeric_limits<double>::quiet_NaN()), StoreError);
  EXPECT_THROW(select.bind(1, std::numeric_limits<double>::infinity()), StoreError);
  EXPECT_THROW(select.bind(1, std::uint64_t{1} << 63), StoreError);
}

}  // namespace
}  // namespace proofmass::coordinator::detail
