#pragma once

#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "worker/spool/spool.hpp"

namespace proofmass::worker {

/// Decides which results go to the spool: those that have waited for their acknowledgement from one
/// look to the next, and all that are left at the end. So a coordinator that answers costs no
/// writing, and a worker that is killed while none does loses little.
class Spooler {
 public:
  /// @param spool  Outlives this object.
  explicit Spooler(Spool& spool);

  /// To be called now and then with the results that are not acknowledged. Returns why they could
  /// not be written, if so; they stay in memory, and the next call tries again.
  [[nodiscard]] std::optional<std::string> look(
      const std::vector<wire::LeasedResult>& unacknowledged);
  /// Likewise at the end, when they will not stay in memory.
  [[nodiscard]] std::optional<std::string> finish(
      const std::vector<wire::LeasedResult>& unacknowledged);

 private:
  using RunKey = std::pair<wire::CampaignId, RunIndex>;

  [[nodiscard]] static RunKey key_of(const wire::LeasedResult& result);
  [[nodiscard]] std::optional<std::string> append(const std::vector<wire::LeasedResult>& results);

  Spool& spool_;
  std::set<RunKey> spooled_;
  std::set<RunKey> seen_;  ///< At the look before.
};

}  // namespace proofmass::worker
