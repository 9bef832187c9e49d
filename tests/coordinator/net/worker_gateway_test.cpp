#include "coordinator/net/worker_gateway.hpp"

#include <gtest/gtest.h>

#include <memory>

#include "core/microscope/definition/campaign_definition.hpp"

namespace proofmass::coordinator {
namespace {

std::shared_ptr<const Campaign> definition(std::uint64_t num_runs) {
  MicroscopeCampaign campaign;
  campaign.num_runs = num_runs;
  return std::make_shared<const MicroscopeCampaign>(campaign);
}

std::size_t encoded_size(const Campaign& campaign) {
  return wire::encode_definition(campaign.definition(TableColumns::included)).size();
}

TEST(DefinitionCache, EncodesADefinitionOnceForAllWorkers) {
  DefinitionCache cache;
  const auto one = definition(10);
  for (int i = 0; i < 300; ++i) (void)cache.part({1}, 0, one);
  EXPECT_EQ(cache.num_encoded(), 1U);
  EXPECT_EQ(cache.size(), encoded_size(*one));
}

TEST(DefinitionCache, EncodesAnExtendedCampaignAgain) {
  DefinitionCache cache;
  const auto before = cache.part({1}, 0, definition(10));
  const auto after = cache.part({1}, 0, definition(11));
  EXPECT_NE(before.checksum(), after.checksum());
  EXPECT_EQ(cache.num_encoded(), 2U);
  EXPECT_EQ(cache.size(), after.total_size());
}

// Workers get the values of the tables with each lease.
TEST(DefinitionCache, LeavesOutTheColumns) {
  MicroscopeCampaign campaign;
  campaign.dispersions[5] = {.law = Law::table, .file = "f.csv", .column = "a"};
  campaign.table_columns = {std::vector<double>(campaign.num_runs, 1e-3)};
  DefinitionCache cache;
  const proto::DefinitionPart part =
      cache.part({1}, 0, std::make_shared<const MicroscopeCampaign>(campaign));
  wire::IncomingDefinition incoming;
  ASSERT_EQ(incoming.add(part), wire::IncomingDefinition::Progress::complete);
  const auto taken = std::get<Definition>(incoming.take());
  EXPECT_TRUE(taken.table_columns.empty());
  EXPECT_EQ(taken, definition_of(campaign, TableColumns::left_out));
}

TEST(DefinitionCache, KeepsThoseThatWereUsedLast) {
  const auto one = definition(10);
  const std::size_t size = encoded_size(*one);
  DefinitionCache cache(2 * size - 1);
  const auto ask = [&](std::uint64_t id) {
    (void)cache.part({id}, 0, one);
    return cache.num_encoded();
  };
  EXPECT_EQ(ask(1), 1U);
  EXPECT_EQ(ask(2), 2U);
  EXPECT_EQ(ask(1), 2U);
  EXPECT_EQ(ask(3), 3U) << "the second makes room";
  EXPECT_EQ(ask(1), 3U);
  EXPECT_EQ(ask(2), 4U);
  EXPECT_LE(cache.size(), 2 * size);
}

}  // namespace
}  // namespace proofmass::coordinator
