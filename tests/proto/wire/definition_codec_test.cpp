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
  return test::refusal_of<proto::Definition>(bytes).text;
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

void expect_refused_definitions(std::string_view path,
                                const std::vector<test::BadChange>& changes) {
  test::expect_refusals<proto::Definition>(
      "text: 'a = 1' tables { key: 'environment.file' num_columns: 2 values: [1, 2] }"
      " table_columns { values: [1, 2] }",
      path, changes);
}

TEST(MalformedDefinition, HasABoundedNumberOfEachThing) {
  const std::string table = "tables { key: 'k' num_columns: 1 } ";
  expect_refused_definitions(
      "", {{"text: ''", "definition.text size = 0 (must be in [1, 1048576])"},
           {"text: " + test::string_of(1048576), "accepted"},
           {"text: " + test::string_of(1048577),
            "definition.text size = 1048577 (must be in [1, 1048576])"},
           {test::times(63, table), "accepted"},
           {test::times(64, table), "definition.tables = 65 entries (must be in [0, 64])"},
           {test::times(1023, "table_columns {} "), "accepted"},
           {test::times(1024, "table_columns {} "),
            "definition.table_columns = 1025 entries (must be in [0, 1024])"}});
}

TEST(MalformedDefinition, HasTablesOfWholeRows) {
  expect_refused_definitions(
      "tables", {{"num_columns: 64 values: [" + test::times(125, "1, ") + "1]", "accepted"},
                 {"values: 1", "definition.tables.values = 3 entries (must be rows of 2)"},
                 {"num_columns: 0", "definition.tables.num_columns = 0 (must be in [1, 64])"},
                 {"num_columns: 65", "definition.tables.num_columns = 65 (must be in [1, 64])"}});
}

TEST(MalformedDefinition, HasTablesWithNamesThatMayBeLogged) {
  expect_refused_definitions("tables",
                             {{"key: ''", "definition.tables.key = 0" + test::name_rule},
                              {"key: 'a b'", "definition.tables.key = 3" + test::name_rule},
                              {"key: 'a\\x1b'", "definition.tables.key = 2" + test::name_rule},
                              {"key: 'a\\n'", "definition.tables.key = 2" + test::name_rule}});
}

TEST(MalformedDefinition, HasFiniteNumbers) {
  for (const std::string value : {"nan", "inf"}) {
    const std::string finite = value + " (must be finite)";
    expect_refused_definitions(
        "tables", {{"-values values: [1, " + value + "]", "definition.tables.values = " + finite}});
    expect_refused_definitions("table_columns", {{"-values values: [1, " + value + "]",
                                                  "definition.table_columns.values = " + finite}});
  }
}

}  // namespace
}  // namespace proofmass::wire
