// What a peer may not send as a definition: each rule of the decoder, broken by one change. What
// the text says is read elsewhere: core/definition/hostile_definition_test.cpp.

#include <functional>
#include <limits>
#include <string>

#include "proto/wire/definition_codec.hpp"
#include "tests/proto/wire/refusal.hpp"

namespace proofmass::wire {
namespace {

using test::nan;

constexpr double infinity = std::numeric_limits<double>::infinity();

std::string refusal_of_definition(const std::function<void(proto::Definition&)>& change) {
  const Definition good{
      .text = "a = 1",
      .tables = {{.key = "environment.file", .num_columns = 2, .values = {1.0, 2.0}}},
      .table_columns = {{1.0, 2.0}}};
  proto::Definition message;
  EXPECT_TRUE(message.ParseFromString(encode_definition(good)));
  EXPECT_EQ(std::get<Definition>(decode_definition(message.SerializeAsString())), good);
  change(message);
  const auto decoded = decode_definition(message.SerializeAsString());
  const auto* const error = std::get_if<DecodeError>(&decoded);
  if (error == nullptr) return "accepted";
  EXPECT_EQ(error->fault, DecodeFault::invalid);
  return error->text;
}

TEST(MalformedDefinition, HasATextOfABoundedSize) {
  EXPECT_EQ(refusal_of_definition([](auto& definition) { definition.clear_text(); }),
            "definition.text size = 0 (must be in [1, 1048576])");
  const auto with = [](std::size_t size) {
    return refusal_of_definition(
        [&](auto& definition) { definition.set_text(std::string(size, 'x')); });
  };
  EXPECT_EQ(with(definition_text_size_max), "accepted");
  EXPECT_EQ(with(definition_text_size_max + 1),
            "definition.text size = 1048577 (must be in [1, 1048576])");
}

TEST(MalformedDefinition, HasABoundedNumberOfTables) {
  const auto with = [](int count) {
    return refusal_of_definition([&](auto& definition) {
      while (definition.tables_size() < count) *definition.add_tables() = definition.tables(0);
    });
  };
  EXPECT_EQ(with(64), "accepted");
  EXPECT_EQ(with(65), "definition.tables = 65 entries (must be in [0, 64])");
}

TEST(MalformedDefinition, HasABoundedNumberOfColumns) {
  const auto with = [](int count) {
    return refusal_of_definition([&](auto& definition) {
      while (definition.table_columns_size() < count) definition.add_table_columns();
    });
  };
  EXPECT_EQ(with(1024), "accepted");
  EXPECT_EQ(with(1025), "definition.table_columns = 1025 entries (must be in [0, 1024])");
}

TEST(MalformedDefinition, HasTablesOfWholeRows) {
  const auto with = [](std::uint32_t num_columns, int num_values) {
    return refusal_of_definition([&](auto& definition) {
      auto& table = *definition.mutable_tables(0);
      table.set_num_columns(num_columns);
      table.clear_values();
      for (int i = 0; i < num_values; ++i) table.add_values(1.0);
    });
  };
  EXPECT_EQ(with(64, 128), "accepted");
  EXPECT_EQ(with(2, 3), "definition.tables.values = 3 entries (must be rows of 2)");
  EXPECT_EQ(with(0, 3), "definition.tables.num_columns = 0 (must be in [1, 64])");
  EXPECT_EQ(with(65, 65), "definition.tables.num_columns = 65 (must be in [1, 64])");
}

TEST(MalformedDefinition, HasTablesWithNamesThatMayBeLogged) {
  for (const std::string key : {"", "a b", "a\x1b", "a\n"}) {
    EXPECT_EQ(refusal_of_definition(
                  [&](auto& definition) { definition.mutable_tables(0)->set_key(key); }),
              "definition.tables.key = " + std::to_string(key.size()) +
                  " bytes (must be 1 to 128 of [A-Za-z0-9._-], a letter or digit first)");
  }
}

TEST(MalformedDefinition, HasFiniteNumbers) {
  for (const auto& [value, text] : {std::pair{nan, "nan"}, {infinity, "inf"}}) {
    EXPECT_EQ(refusal_of_definition(
                  [&](auto& definition) { definition.mutable_tables(0)->set_values(1, value); }),
              std::string("definition.tables.values = ") + text + " (must be finite)");
    EXPECT_EQ(refusal_of_definition([&](auto& definition) {
                definition.mutable_table_columns(0)->set_values(1, value);
              }),
              std::string("definition.table_columns.values = ") + text + " (must be finite)");
  }
}

}  // namespace
}  // namespace proofmass::wire
