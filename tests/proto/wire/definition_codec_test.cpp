#include "proto/wire/definition_codec.hpp"

#include "tests/proto/wire/refusal.hpp"
#include "tests/test.hpp"

namespace proofmass::wire {
namespace {

using Progress = IncomingDefinition::Progress;

/// One that needs three parts.
Definition large_definition(double first_value = 1e-9) {
  Definition definition{.text = "a = 1", .tables = {{.key = "t", .num_columns = 7}}};
  definition.tables[0].values.assign(70'000, 1.0);
  definition.tables[0].values[0] = first_value;
  return definition;
}

const Definition small_definition{.text = "a = 1"};

TEST(EncodedDefinition, GivesPartsThatMakeTheWhole) {
  const Definition definition = large_definition(1e-8);
  const EncodedDefinition encoded(definition);
  IncomingDefinition incoming;
  std::size_t num_parts = 0;
  Progress progress = Progress::advanced;
  while (progress == Progress::advanced) {
    const proto::DefinitionPart part = encoded.part({5}, incoming.num_bytes());
    EXPECT_EQ(part.campaign(), 5U);
    EXPECT_LE(part.content().size(), definition_part_size_max);
    progress = incoming.add(part);
    ++num_parts;
  }
  EXPECT_EQ(num_parts, encoded.size() / definition_part_size_max + 1);
  EXPECT_EQ(num_parts, 3U);
  ASSERT_EQ(progress, Progress::complete);
  EXPECT_EQ(incoming.take(), definition);
}

TEST(EncodedDefinition, GivesItsFirstPartToAWorkerThatHasMoreThanThereIs) {
  const EncodedDefinition encoded(small_definition);
  EXPECT_EQ(encoded.part({5}, encoded.size()).offset(), 0U);
}

TEST(IncomingDefinition, IgnoresWhatItHas) {
  const EncodedDefinition encoded(large_definition());
  IncomingDefinition incoming;
  const proto::DefinitionPart first = encoded.part({5}, 0);
  EXPECT_EQ(incoming.add(first), Progress::advanced);
  EXPECT_EQ(incoming.add(first), Progress::ignored);
  EXPECT_EQ(incoming.num_bytes(), definition_part_size_max);
}

// The part of the old version is as long as that of the new one: only the checksum differs.
TEST(IncomingDefinition, DoesNotMixTwoVersions) {
  const EncodedDefinition old_version(large_definition(1e-8));
  const EncodedDefinition new_version(large_definition(2e-8));
  ASSERT_EQ(old_version.size(), new_version.size());
  IncomingDefinition incoming;
  EXPECT_EQ(incoming.add(old_version.part({5}, 0)), Progress::advanced);
  EXPECT_EQ(incoming.add(new_version.part({5}, incoming.num_bytes())), Progress::advanced);
  EXPECT_EQ(incoming.num_bytes(), 0U);
}

TEST(IncomingDefinition, RefusesDamagedBytes) {
  proto::DefinitionPart part = EncodedDefinition(small_definition).part({5}, 0);
  part.mutable_content()->back() ^= 1;
  IncomingDefinition incoming;
  ASSERT_EQ(incoming.add(part), Progress::complete);
  EXPECT_THAT(proofmass::test::message_of<Error>([&] { (void)incoming.take(); }),
              testing::StartsWith("checksum = "));
  EXPECT_EQ(incoming.num_bytes(), 0U) << "it can begin anew";
}

std::string error_of(const std::string& bytes) {
  try {
    (void)decode_definition(bytes);
    return "accepted";
  } catch (const Error& error) {
    return error.what();
  }
}

TEST(DecodeDefinition, BoundsSizeAndFields) {
  EXPECT_EQ(error_of(std::string(definition_size_max + 1, 'x')),
            "definition size = 67108865 bytes (must be at most 67108864)");
  EXPECT_EQ(error_of("GET / HTTP/1.1"),
            "definition = 14 bytes (must be a definition of at most 4096 fields)");
  std::string tables;
  for (int i = 0; i < 4097; ++i) tables += std::string("\x12\0", 2);  // Field 2, empty.
  EXPECT_EQ(error_of(tables),
            "definition = 8194 bytes (must be a definition of at most 4096 fields)");
  EXPECT_EQ(error_of("\x0a\x01\xff"),  // A text that is not UTF-8.
            "definition = 3 bytes (must be a definition of at most 4096 fields)");
}

// What a peer may not send as a definition: each rule of the decoder, broken by one change. What
// the text says is read elsewhere: core/definition/hostile_definition_test.cpp.

using test::nan;

constexpr double infinity = std::numeric_limits<double>::infinity();

std::string refusal_of_definition(const std::function<void(proto::Definition&)>& change) {
  const Definition good{
      .text = "a = 1",
      .tables = {{.key = "environment.file", .num_columns = 2, .values = {1.0, 2.0}}},
      .table_columns = {{1.0, 2.0}}};
  proto::Definition message;
  EXPECT_TRUE(message.ParseFromString(encode_definition(good)));
  EXPECT_EQ(decode_definition(message.SerializeAsString()), good);
  change(message);
  return error_of(message.SerializeAsString());
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
