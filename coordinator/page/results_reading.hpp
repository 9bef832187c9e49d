#pragma once

#include <cstdint>

#include "coordinator/dispatch/run_set.hpp"
#include "coordinator/report/live_results.hpp"
#include "coordinator/store/store.hpp"
#include "proto/wire/messages.hpp"

namespace proofmass::coordinator {

/// Results that were read of a campaign database, a part at a time. Results never change: what was
/// read once stays, and only what has come since is read further. A copy costs little.
class ResultsReading {
 public:
  /// Nothing is read yet.
  /// @throws StoreError, ConfigError as stored_campaign().
  explicit ResultsReading(const Store& store);

  /// Whether the file has the campaign that this was begun with, and not another one that has its
  /// place now.
  [[nodiscard]] bool is_of(const Store& store) const;

  /// Reads some `num_results_max` results at most that are in the file and were not read before;
  /// the next call goes on after them.
  /// @throws StoreError if the file cannot be read or is damaged.
  void read_further(const Store& store, std::uint64_t num_results_max);

  [[nodiscard]] std::uint64_t num_read() const { return read_.size(); }
  [[nodiscard]] const LiveResults& results() const { return results_; }

 private:
  wire::CampaignId campaign_;
  LiveResults results_;
  RunSet read_;
  std::uint64_t next_run_ = 0;  ///< Where the next call begins.
};

}  // namespace proofmass::coordinator
