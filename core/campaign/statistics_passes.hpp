#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

#include "core/campaign/statistics.hpp"
#include "core/statistics/value_passes.hpp"

namespace proofmass {

/// Statistics of a campaign's results, which are seen in several passes and not kept: those of
/// StatisticsAccumulator, to the last bit. Memory does not grow with the runs: it is some 130 MB at
/// most.
class StatisticsPasses {
 public:
  /// @param objectives    Largest acceptable |error| of each quantity, SI.
  /// @param num_kept_max  Runs that are kept, and up to which one pass is enough; for tests.
  explicit StatisticsPasses(std::vector<double> objectives,
                            std::size_t num_kept_max = num_passed_values_kept);

  /// @pre Runs of a pass are added in strictly ascending order.
  void add(const RunResult& result);
  /// @return True if another pass, with the same results, is needed.
  [[nodiscard]] bool end_pass();
  /// @pre No further pass is needed.
  [[nodiscard]] CampaignStatistics statistics() const;

 private:
  /// What is computed of one quantity.
  struct QuantityPasses {
    ValuePasses errors;      ///< estimate − truth.
    ValuePasses magnitudes;  ///< |estimate − truth|.
    double worst = 0.0;
    RunIndex worst_run;
    std::uint64_t num_beyond = 0;
  };

  void count(const RunResult& result);
  [[nodiscard]] AccuracyStatistic accuracy(const QuantityPasses& quantity) const;

  std::vector<double> objectives_;
  CampaignStatistics counts_;
  bool is_first_pass_ = true;
  std::optional<RunIndex> last_run_;  ///< Of this pass.
  std::vector<QuantityPasses> quantities_;
};

}  // namespace proofmass
