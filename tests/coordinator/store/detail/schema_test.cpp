#include "coordinator/store/detail/schema.hpp"

#include <gmock/gmock.h>

#include "core/campaign/parameter.hpp"
#include "tests/coordinator/store/store_fixture.hpp"

namespace proofmass::coordinator::detail {
namespace {

using SchemaTest = test::StoreTest;

/// All statements of a schema, in order.
std::string schema_text(const Database& database) {
  return database.text("SELECT group_concat(sql, ';') FROM sqlite_schema");
}

TEST_F(SchemaTest, HasTheSameTablesFromWhateverVersionItWasBroughtUp) {
  Database fresh(directory() / "fresh.db", Access::create);
  {
    Transaction transaction(fresh);
    migrate(fresh);
    transaction.commit();
  }
  for (std::size_t version = 1; version <= migrations().size(); ++version) {
    Database old(directory() / (std::to_string(version) + ".db"), Access::create);
    for (std::size_t i = 0; i < version; ++i) old.execute(std::string(migrations()[i]));
    Transaction transaction(old);
    migrate(old);
    transaction.commit();
    EXPECT_EQ(old.integer("PRAGMA user_version"), schema_version());
    EXPECT_EQ(schema_text(old), schema_text(fresh));
  }
}

TEST_F(SchemaTest, IsBroughtUpToDateWhenACoordinatorOpensTheFile) {
  {
    Database old(file(), Access::create);
    old.execute(std::string(migrations()[0]));
    old.execute("INSERT INTO campaign VALUES (1, 'old', '42', 5, 'text', 'proofmass 0', '')");
  }
  const Store store = Store::open(file());
  EXPECT_EQ(store.name(), "old");
  EXPECT_EQ(store.seed(), 42u);
  EXPECT_TRUE(store.finished_runs().empty());
  EXPECT_EQ(Store::open_read_only(file()).num_runs(), 5u);
}

TEST_F(SchemaTest, MarksTheFileAsACampaign) {
  Database database(file(), Access::create);
  database.execute(std::string(migrations()[0]));
  EXPECT_EQ(database.integer("PRAGMA application_id"), application_id);
  database.execute(
      "INSERT INTO campaign (name, seed, num_runs, definition, model_version)"
      " VALUES ('a', '1', 1, '', 'm')");
  check_campaign_file(database, file());
}

// The schema is text that no program made: each parameter must stand in it with its unit.
TEST_F(SchemaTest, HasThreeColumnsForEachParameterAndThoseOfHealth) {
  Database database(file(), Access::create);
  for (const std::string_view migration : migrations()) database.execute(std::string(migration));
  std::string expected = "run_index,status,num_draws,num_rounds";
  for (const std::string kind : {"truth", "estimate", "error"}) {
    for (const ParameterInfo& info : parameter_infos()) {
      expected += "," + kind + "_" + std::string(info.name) + std::string(info.unit_suffix);
    }
  }
  for (const HealthValue& value : health_values()) {
    expected += ",health_" + std::string(value.name) + std::string(value.unit_suffix);
  }
  expected += ",loss_cause,loss_session";
  EXPECT_EQ(database.text("SELECT group_concat(name) FROM pragma_table_xinfo('run_result')"),
            expected);
}

TEST_F(SchemaTest, HasStrictTablesOnly) {
  Database database(file(), Access::create);
  for (const std::string_view migration : migrations()) database.execute(std::string(migration));
  EXPECT_EQ(database.integer("SELECT count(*) FROM pragma_table_list WHERE type = 'table' AND NOT "
                             "strict AND name NOT LIKE 'sqlite%'"),
            0);
}

// Each row is refused by one rule: a result must have what its status says, and no more.
TEST_F(SchemaTest, TiesEveryNumberToTheStatus) {
  Store::create(file(), test::campaign_of(10), "").commit(test::deliveries_of(0, 1));
  Database database(file(), Access::read_write);
  for (const ParameterInfo& info : parameter_infos()) {
    const std::string name = std::string(info.name) + std::string(info.unit_suffix);
    for (const std::string kind : {"truth_", "estimate_"}) {
      const std::string column = kind + name;
      EXPECT_EQ(test::store_error_of(
                    [&] { database.execute("UPDATE run_result SET " + column + " = NULL"); }),
                "campaign file = " + file().string() + " (CHECK constraint failed: (" + column +
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
