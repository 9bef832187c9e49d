// Files that older programs made.

#include <gmock/gmock.h>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/detail/schema.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/parameter.hpp"
#include "tests/coordinator/store/store_fixture.hpp"

namespace proofmass::coordinator {
namespace {

using detail::Access;
using detail::Database;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

class StoreMigration : public test::StoreTest {
 protected:
  /// A file of version 3 with runs 0 and 1 by `näh`, and run 4 by `worker-2`.
  void make_file_of_version_3() const {
    Database old(file(), Access::create);
    for (int i = 0; i < 3; ++i) {
      old.execute(std::string(detail::migrations()[static_cast<std::size_t>(i)]));
    }
    old.execute("INSERT INTO campaign VALUES (1, 'old', '42', 5, 'text', 'hardy2013-1', '')");
    for (const int run : {0, 1, 4}) {
      old.execute("INSERT INTO run_result (run_index, status, num_draws, num_rounds) VALUES (" +
                  std::to_string(run) + ", 4, 1, 0)");
    }
    old.execute(
        "INSERT INTO delivery VALUES (0, 'näh', 0, 2.5, '2024-02-29T12:00:00.250Z'),"
        " (1, 'näh', 3, 0.5, '2024-02-29T12:00:10.999Z'),"
        " (4, 'worker-2', 0, 1.0, '2024-03-01T00:00:00.000Z')");
  }
};

TEST_F(StoreMigration, FromVersion3KeepsResultsAndWhoDeliveredThem) {
  make_file_of_version_3();
  Store store = Store::open(file());

  EXPECT_THAT(store.finished_runs(),
              ElementsAre(RunRange{RunIndex{0}, 2}, RunRange{RunIndex{4}, 1}));
  const Database database(file(), Access::read_only);
  EXPECT_EQ(
      database.text("SELECT group_concat(run_index || ' ' || name || ' ' || attempt || ' ' || "
                    "d.compute_s || ' ' || received_unix_s, ';') "
                    "FROM delivery AS d JOIN worker ON worker = worker_key"),
      "0 näh 0 2.5 1709208000;1 näh 3 0.5 1709208010;4 worker-2 0 1.0 1709251200");
  EXPECT_EQ(database.text("SELECT group_concat(worker || ' ' || num_results || ' ' || compute_s || "
                          "' ' || last_result_utc, ';') FROM worker_throughput"),
            "näh 2 3.0 2024-02-29T12:00:10Z;worker-2 1 1.0 2024-03-01T00:00:00Z");
  EXPECT_EQ(database.integer("SELECT count(*) FROM pragma_foreign_key_check"), 0);
  EXPECT_EQ(store.commit(test::deliveries_of(0, 5)).num_new, 2u);
}

TEST_F(StoreMigration, FromVersion3MakesACampaignToBeServed) {
  make_file_of_version_3();
  const wire::CampaignId id = Store::open(file()).id();
  const Store store = Store::open(file());
  EXPECT_EQ(store.id(), id);
  EXPECT_GT(id.value, 1u);
  EXPECT_EQ(store.build(), "");
  EXPECT_EQ(store.control(), CampaignControl{});
  EXPECT_THAT(store.attached_sessions(), IsEmpty());  // Their sessions are not known.
  EXPECT_THAT(store.blamed_runs(), IsEmpty());
  EXPECT_THAT(store.given_up_runs(), IsEmpty());
}

// A table in the way: nothing of the step may remain.
TEST_F(StoreMigration, ThatFailsLeavesTheFileAsItWas) {
  make_file_of_version_3();
  Database(file(), Access::read_write).execute("CREATE TABLE worker (x INTEGER)");
  EXPECT_EQ(test::store_error_of([&] { Store::open(file()); }),
            "campaign file = " + file().string() + " (table worker already exists)");
  const Database database(file(), Access::read_only);
  EXPECT_EQ(database.integer("PRAGMA user_version"), 3);
  EXPECT_EQ(database.text("SELECT group_concat(worker) FROM delivery"), "näh,näh,worker-2");
  EXPECT_EQ(database.integer("SELECT count(*) FROM pragma_table_info('campaign') WHERE name = "
                             "'campaign_uid'"),
            0);
}

}  // namespace
}  // namespace proofmass::coordinator
