#include "coordinator/store/detail/schema.hpp"

#include <gmock/gmock.h>

#include "core/microscope/results/health.hpp"
#include "tests/coordinator/store/store_fixture.hpp"
#include "tests/support/microscope_results.hpp"

namespace proofmass::coordinator::detail {
namespace {

using SchemaTest = test::StoreTest;

TEST_F(SchemaTest, MarksTheFileAsACampaign) {
  Database database(file(), Access::create);
  database.execute(migrations()[0]);
  EXPECT_EQ(database.integer("PRAGMA application_id"), application_id);
  database.execute(
      "INSERT INTO campaign (campaign_uid, name, seed, num_runs, definition, model_version, build)"
      " VALUES (1, 'a', '1', 1, '', 'm', '')");
  check_campaign_file(database);
}

// What is asked of the file by others: each parameter with its unit.
TEST_F(SchemaTest, HasThreeColumnsForEachParameterAndThoseOfHealth) {
  Database database(file(), Access::create);
  database.execute(migrations()[0]);
  std::string expected = "run_index,status,num_draws,num_rounds";
  for (const std::string kind : {"truth", "estimate", "error"}) {
    for (const test::ParameterInfo& info : test::parameter_infos()) {
      expected += "," + kind + "_" + std::string(info.name) + std::string(info.unit_suffix);
    }
  }
  for (const HealthValue& value : health_values()) {
    expected +=
        ",health_" + std::string(value.quantity.name) + std::string(value.quantity.unit_suffix);
  }
  expected += ",loss_cause,loss_session";
  EXPECT_EQ(database.text("SELECT group_concat(name) FROM pragma_table_xinfo('run_result')"),
            expected);
}

TEST_F(SchemaTest, HasStrictTablesOnly) {
  Database database(file(), Access::create);
  database.execute(migrations()[0]);
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

}  // namespace
}  // namespace proofmass::coordinator::detail
