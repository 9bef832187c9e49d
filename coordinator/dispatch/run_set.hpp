#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "core/campaign/identifiers.hpp"

namespace proofmass::coordinator {

/// A set of runs, kept as disjoint ranges that do not touch: a campaign of 10⁹ pending runs is one
/// entry.
class RunSet {
 public:
  RunSet() = default;
  explicit RunSet(RunRange range) { add(range); }

  /// Adds the runs of the range; those that are in the set already stay.
  void add(RunRange range);
  /// @return False if the run was not in the set.
  bool remove(RunIndex run);
  /// Removes and returns the longest range at the beginning of the set with at most `count_max`
  /// runs. @pre Not empty; count_max > 0.
  [[nodiscard]] RunRange take_first(std::uint64_t count_max);

  [[nodiscard]] bool contains(RunIndex run) const;
  [[nodiscard]] bool empty() const { return ends_.empty(); }
  [[nodiscard]] std::uint64_t size() const { return size_; }  ///< Number of runs.
  [[nodiscard]] std::vector<RunRange> ranges() const;         ///< Ascending.

  bool operator==(const RunSet&) const = default;

 private:
  std::map<std::uint64_t, std::uint64_t> ends_;  ///< First run of a range → one past its last.
  std::uint64_t size_ = 0;
};

/// For logs: `0..9,12,20..31`; the first few ranges only, then `...`. `none` if empty.
[[nodiscard]] std::string to_text(const RunSet& runs);

}  // namespace proofmass::coordinator
