#include "proto/wire/definition_codec.hpp"

#include <gtest/gtest.h>

#include <string>
#include <variant>
#include <vector>

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
  const auto taken = incoming.take();
  EXPECT_EQ(std::get<Definition>(taken), definition);
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
  const auto taken = incoming.take();
  const auto* const error = std::get_if<DecodeError>(&taken);
  ASSERT_NE(error, nullptr);
  EXPECT_EQ(error->text.substr(0, 11), "checksum = ");
  EXPECT_EQ(incoming.num_bytes(), 0U) << "it can begin anew";
}

std::string error_of(const std::string& bytes) {
  const auto decoded = decode_definition(bytes);
  const auto* const error = std::get_if<DecodeError>(&decoded);
  return error == nullptr ? "accepted" : error->text;
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

}  // namespace
}  // namespace proofmass::wire
