#include "coordinator/dispatch/lease_index.hpp"

#include <algorithm>
#include <iterator>

#include "core/error.hpp"

namespace proofmass::coordinator {

void LeaseIndex::add(RunRange runs, LeaseId lease) {
  const auto next = entries_.lower_bound(runs.first.value);
  PROOFMASS_EXPECT(next == entries_.end() || next->first >= runs.end());
  PROOFMASS_EXPECT(next == entries_.begin() || std::prev(next)->second.end <= runs.first.value);
  entries_.emplace_hint(next, runs.first.value, Entry{.end = runs.end(), .lease = lease});
  size_ += runs.count;
}

void LeaseIndex::remove(RunRange runs) {
  std::uint64_t first = runs.first.value;
  while (first < runs.end()) {
    auto found = entries_.upper_bound(first);
    PROOFMASS_EXPECT(found != entries_.begin());
    --found;
    const std::uint64_t entry_first = found->first;
    const Entry entry = found->second;
    PROOFMASS_EXPECT(first < entry.end);
    const std::uint64_t end = std::min(entry.end, runs.end());
    auto next = entries_.erase(found);
    if (end < entry.end) next = entries_.emplace_hint(next, end, entry);
    if (entry_first < first) {
      entries_.emplace_hint(next, entry_first, Entry{.end = first, .lease = entry.lease});
    }
    size_ -= end - first;
    first = end;
  }
}

std::optional<LeaseId> LeaseIndex::find(RunIndex run) const {
  const auto next = entries_.upper_bound(run.value);
  if (next == entries_.begin()) return std::nullopt;
  const Entry& entry = std::prev(next)->second;
  if (run.value >= entry.end) return std::nullopt;
  return entry.lease;
}

RunSet LeaseIndex::overlap(RunRange runs) const {
  RunSet overlap;
  auto entry = entries_.upper_bound(runs.first.value);
  if (entry != entries_.begin()) --entry;
  for (; entry != entries_.end() && entry->first < runs.end(); ++entry) {
    const std::uint64_t first = std::max(entry->first, runs.first.value);
    const std::uint64_t end = std::min(entry->second.end, runs.end());
    if (first < end) overlap.add({.first = {first}, .count = end - first});
  }
  return overlap;
}

RunSet LeaseIndex::runs() const {
  RunSet runs;
  for (const auto& [first, entry] : entries_) {
    runs.add({.first = {first}, .count = entry.end - first});
  }
  return runs;
}

}  // namespace proofmass::coordinator
