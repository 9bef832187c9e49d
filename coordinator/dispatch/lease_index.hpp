#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "coordinator/dispatch/identifiers.hpp"
#include "coordinator/dispatch/run_set.hpp"

namespace proofmass::coordinator {

/// Which lease each of a campaign's lent runs is on. Kept as ranges, like RunSet.
class LeaseIndex {
 public:
  /// @pre None of the runs is in the index.
  void add(RunRange runs, LeaseId lease);
  /// @pre All runs of the range are in the index.
  void remove(RunRange runs);

  [[nodiscard]] std::optional<LeaseId> find(RunIndex run) const;
  /// The runs of the range that are in the index.
  [[nodiscard]] RunSet overlap(RunRange runs) const;
  [[nodiscard]] bool empty() const { return entries_.empty(); }
  [[nodiscard]] std::uint64_t size() const { return size_; }  ///< Number of runs.
  [[nodiscard]] RunSet runs() const;

 private:
  struct Entry {
    std::uint64_t end = 0;  ///< One past the last run.
    LeaseId lease;
  };
  std::map<std::uint64_t, Entry> entries_;  ///< By their first run.
  std::uint64_t size_ = 0;
};

}  // namespace proofmass::coordinator
