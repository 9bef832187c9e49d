#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace proofmass::coordinator {

/// Workers of one machine that computed runs of a campaign.
struct HostShare {
  std::string host;  ///< As it named itself.
  std::uint64_t num_workers = 0;
  std::uint64_t num_results = 0;
  double compute_s = 0.0;  ///< Time of processor cores.
};

/// Runs that came back without a result, for one reason.
struct LossShare {
  std::string reason;
  std::uint64_t num_losses = 0;  ///< Ranges of runs.
  std::uint64_t num_runs = 0;
  bool is_blamed = false;  ///< They count against these runs.
};

/// How a campaign was computed, as far as its database keeps it.
struct Execution {
  std::uint64_t num_coordinators = 0;  ///< Starts of one.
  std::uint64_t num_workers = 0;
  std::uint64_t num_hosts = 0;
  double compute_s = 0.0;        ///< Of the results that were kept; time of processor cores.
  std::vector<HostShare> hosts;  ///< At most 20, those with the most results first.
  std::vector<LossShare> losses;
  std::uint64_t num_retried = 0;  ///< Results that were kept of a later attempt than the first.
  std::uint64_t num_audited = 0;  ///< Results that were compared with a second one.
  std::uint64_t num_contradicting = 0;  ///< Second results that differed.
  std::optional<std::string> first_result_utc;
  std::optional<std::string> last_result_utc;
};

}  // namespace proofmass::coordinator
