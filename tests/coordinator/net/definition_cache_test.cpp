#include "coordinator/net/definition_cache.hpp"

#include <gtest/gtest.h>

#include <memory>

namespace proofmass::coordinator {
namespace {

std::shared_ptr<const Campaign> definition(std::uint64_t num_runs) {
  Campaign campaign;
  campaign.num_runs = num_runs;
  return std::make_shared<const Campaign>(campaign);
}

TEST(DefinitionCache, EncodesADefinitionOnceForAllWorkers) {
  DefinitionCache cache;
  const auto one = definition(10);
  for (int i = 0; i < 300; ++i) (void)cache.part({.campaign = {1}, .offset = 0}, one);
  EXPECT_EQ(cache.num_encoded(), 1U);
  EXPECT_EQ(cache.size(), wire::encode_definition(*one).size());
}

TEST(DefinitionCache, EncodesAnExtendedCampaignAgain) {
  DefinitionCache cache;
  const auto before = cache.part({.campaign = {1}, .offset = 0}, definition(10));
  const auto after = cache.part({.campaign = {1}, .offset = 0}, definition(11));
  EXPECT_NE(before.checksum, after.checksum);
  EXPECT_EQ(cache.num_encoded(), 2U);
  EXPECT_EQ(cache.size(), after.total_size);
}

TEST(DefinitionCache, KeepsThoseThatWereUsedLast) {
  const auto one = definition(10);
  const std::size_t size = wire::encode_definition(*one).size();
  DefinitionCache cache(2 * size - 1);
  const auto ask = [&](std::uint64_t id) {
    (void)cache.part({.campaign = {id}, .offset = 0}, one);
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
