#include <gtest/gtest.h>

#include <cstdint>
#include <sstream>
#include <string>

#include "coordinator/cli/cost_estimate.hpp"
#include "core/model.hpp"
#include "proto/link/machine.hpp"

namespace proofmass::coordinator {
namespace {

TEST(CostEstimate, CountsAnIncompleteBatchAsAWhole) {
  const std::uint64_t batch_size = model().batch_size();
  const std::uint64_t num_at_once = batch_size * wire::num_processors();
  EXPECT_EQ(estimated_cost(1, 2.5).one_core_s, 2.5);
  EXPECT_EQ(estimated_cost(batch_size, 2.5).one_core_s, 2.5);
  EXPECT_EQ(estimated_cost(batch_size + 1, 2.5).one_core_s, 5.0);
  EXPECT_EQ(estimated_cost(100 * batch_size, 2.5).one_core_s, 250.0);
  EXPECT_EQ(estimated_cost(num_at_once, 2.5).all_cores_s, 2.5);
  EXPECT_EQ(estimated_cost(num_at_once + 1, 2.5).all_cores_s, 5.0);
}

TEST(CostEstimate, FitsATerminalOf80Columns) {
  constexpr double long_s = 99 * 86400.0 + 23 * 3600.0;
  std::istringstream lines(
      cost_text({.one_core_s = long_s, .all_cores_s = long_s, .disk_mb = 290000.5}));
  for (std::string line; std::getline(lines, line);) EXPECT_LT(line.size(), 80U) << line;
}

}  // namespace
}  // namespace proofmass::coordinator
