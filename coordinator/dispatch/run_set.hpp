#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/runs.hpp"

namespace proofmass::coordinator {

/// A set of runs, kept as disjoint ranges that do not touch: a campaign of 10⁹ pending runs is one
/// entry.
class RunSet {
 public:
  RunSet() = default;
  explicit RunSet(RunRange range) { add(range); }
  explicit RunSet(std::span<const RunRange> ranges) {
    for (const RunRange& range : ranges) add(range);
  }

  /// Adds the runs of the range; those that are in the set already stay.
  void add(RunRange range);
  void add(const RunSet& runs);
  /// @return False if the run was not in the set.
  bool remove(RunIndex run);
  /// Removes those runs of the range that are in the set.
  void remove(RunRange range);
  void remove(const RunSet& runs);
  /// Removes and returns the first `count_max` runs, or all if they are fewer.
  [[nodiscard]] RunSet take_first(std::uint64_t count_max);
  /// Removes and returns the last `count` runs. @pre There are that many.
  [[nodiscard]] RunSet take_last(std::uint64_t count);

  [[nodiscard]] bool contains(RunIndex run) const;
  /// The runs of the range that are in the set.
  [[nodiscard]] RunSet overlap(RunRange range) const;
  [[nodiscard]] RunSet overlap(const RunSet& runs) const;
  [[nodiscard]] bool empty() const { return ends_.empty(); }
  [[nodiscard]] std::uint64_t size() const { return size_; }  ///< Number of runs.
  [[nodiscard]] std::size_t num_ranges() const { return ends_.size(); }
  [[nodiscard]] std::vector<RunRange> ranges() const;                      ///< Ascending.
  [[nodiscard]] RunIndex first() const { return {ends_.begin()->first}; }  ///< @pre Not empty.

  bool operator==(const RunSet&) const = default;

 private:
  std::map<std::uint64_t, std::uint64_t> ends_;  ///< First run of a range → one past its last.
  std::uint64_t size_ = 0;
};

/// For logs: `0..9,12,20..31`; the first few ranges only, then `...`. `none` if empty.
[[nodiscard]] std::string to_text(const RunSet& runs);

/// Number of a lease, unique for a coordinator's lifetime, from 1. Known to the dispatch alone.
struct LeaseId {
  std::uint64_t value = 0;
  auto operator<=>(const LeaseId&) const = default;
};

/// Which lease each of some runs of a campaign is on.
class LeaseIndex {
 public:
  /// @pre None of the runs is in the index.
  void add(RunRange runs, LeaseId lease);
  /// @pre All runs of the range are in the index.
  void remove(RunRange runs);

  [[nodiscard]] std::optional<LeaseId> find(RunIndex run) const;
  [[nodiscard]] const RunSet& runs() const { return runs_; }
  [[nodiscard]] bool empty() const { return runs_.empty(); }

 private:
  RunSet runs_;
  std::map<std::uint64_t, LeaseId> leases_;  ///< By the first run of each of its ranges.
};

}  // namespace proofmass::coordinator
