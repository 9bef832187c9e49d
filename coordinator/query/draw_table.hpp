#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include "core/campaign/campaign.hpp"
#include "core/runs.hpp"

namespace proofmass::coordinator {

/// What the runs of a campaign draw, computed again when asked for.
class DrawnCampaign {
 public:
  explicit DrawnCampaign(std::shared_ptr<const Campaign> campaign);

  [[nodiscard]] std::string_view campaign_name() const { return campaign_->name; }
  [[nodiscard]] std::uint64_t num_runs() const { return campaign_->num_runs; }

  /// The values of the run's accepted draw, those its simulation begins with; empty if all draws
  /// were rejected. The reference holds until the next call.
  /// @pre The run is one of the campaign's.
  [[nodiscard]] const std::vector<double>& values_of(RunIndex run);

 private:
  std::shared_ptr<const Campaign> campaign_;
  std::optional<RunIndex> last_run_;  ///< A join asks for the quantities of a run one by one.
  std::vector<double> last_values_;
};

/// A comparison that SQL makes with a run index.
enum class RunComparison : std::uint8_t { equal, above, at_least, below, at_most };

/// The rows of draw() that a statement wants: at least those, as SQLite looks at each row again.
struct DrawScan {
  std::uint64_t first_run = 0;
  std::uint64_t end_run = 0;            ///< One behind the last.
  std::optional<std::size_t> quantity;  ///< Index into Model::drawn(); empty for all.

  /// Leaves out runs that cannot hold `run_index <comparison> bound`.
  void narrow(RunComparison comparison, std::int64_t bound);
  void narrow(RunComparison comparison, double bound);
  void leave_none() { end_run = first_run; }
};

}  // namespace proofmass::coordinator
