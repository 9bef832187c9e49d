#include "proto/wire/definition_codec.hpp"

#include <gtest/gtest.h>

#include <string>
#include <variant>
#include <vector>

namespace proofmass::wire {
namespace {

using Progress = IncomingDefinition::Progress;

/// One that needs three parts.
Campaign large_campaign(double first_value = 1e-9) {
  Campaign campaign;
  campaign.environment_table.resize(10'000);
  double time_s = 0.0;
  for (auto& row : campaign.environment_table) row.time_s = time_s++;
  campaign.environment_table[0].linear_m_s2[0] = first_value;
  campaign.scenario.environment.kind = EnvironmentKind::file;
  campaign.environment_file = "e.csv";
  return campaign;
}

TEST(EncodedDefinition, GivesPartsThatMakeTheWhole) {
  const Campaign campaign = large_campaign(1e-8);
  const EncodedDefinition encoded(campaign);
  IncomingDefinition incoming;
  std::size_t num_parts = 0;
  Progress progress = Progress::advanced;
  while (progress == Progress::advanced) {
    const DefinitionPart part = encoded.part({.campaign = {5}, .offset = incoming.num_bytes()});
    EXPECT_EQ(part.campaign, CampaignId{5});
    EXPECT_LE(part.content.size(), definition_part_size_max);
    progress = incoming.add(part);
    ++num_parts;
  }
  EXPECT_EQ(num_parts, encoded.size() / definition_part_size_max + 1);
  EXPECT_EQ(num_parts, 3U);
  ASSERT_EQ(progress, Progress::complete);
  const auto taken = incoming.take();
  const auto& definition = std::get<std::shared_ptr<const Campaign>>(taken);
  EXPECT_EQ(definition->environment_table, campaign.environment_table);
}

TEST(EncodedDefinition, GivesItsFirstPartToAWorkerThatHasMoreThanThereIs) {
  const EncodedDefinition encoded(Campaign{});
  EXPECT_EQ(encoded.part({.campaign = {5}, .offset = encoded.size()}).offset, 0U);
}

TEST(IncomingDefinition, IgnoresWhatItHas) {
  const EncodedDefinition encoded(large_campaign());
  IncomingDefinition incoming;
  const DefinitionPart first = encoded.part({.campaign = {5}, .offset = 0});
  EXPECT_EQ(incoming.add(first), Progress::advanced);
  EXPECT_EQ(incoming.add(first), Progress::ignored);
  EXPECT_EQ(incoming.num_bytes(), definition_part_size_max);
}

// The part of the old version is as long as that of the new one: only the checksum differs.
TEST(IncomingDefinition, DoesNotMixTwoVersions) {
  const EncodedDefinition old_version(large_campaign(1e-8));
  const EncodedDefinition new_version(large_campaign(2e-8));
  ASSERT_EQ(old_version.size(), new_version.size());
  IncomingDefinition incoming;
  EXPECT_EQ(incoming.add(old_version.part({.campaign = {5}, .offset = 0})), Progress::advanced);
  EXPECT_EQ(incoming.add(new_version.part({.campaign = {5}, .offset = incoming.num_bytes()})),
            Progress::advanced);
  EXPECT_EQ(incoming.num_bytes(), 0U);
}

TEST(IncomingDefinition, RefusesDamagedBytes) {
  DefinitionPart part = EncodedDefinition(Campaign{}).part({.campaign = {5}, .offset = 0});
  part.content.back() ^= 1;
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
            "definition = 14 bytes (must be a campaign of at most 65536 fields)");
  std::string sessions;
  for (int i = 0; i < 65537; ++i) sessions += std::string("\x2a\0", 2);  // Field 5, empty.
  EXPECT_EQ(error_of(sessions),
            "definition = 131074 bytes (must be a campaign of at most 65536 fields)");
}

}  // namespace
}  // namespace proofmass::wire
