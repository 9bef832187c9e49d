#include "coordinator/dispatch/run_set.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <iterator>

#include "core/error.hpp"

namespace proofmass::coordinator {

void RunSet::add(RunRange range) {
  if (range.count == 0) return;
  std::uint64_t first = range.first.value;
  std::uint64_t end = range.end();
  auto next = ends_.upper_bound(first);
  if (next != ends_.begin() && std::prev(next)->second >= first) --next;
  while (next != ends_.end() && next->first <= end) {
    first = std::min(first, next->first);
    end = std::max(end, next->second);
    size_ -= next->second - next->first;
    next = ends_.erase(next);
  }
  ends_.emplace(first, end);
  size_ += end - first;
}

void RunSet::add(const RunSet& runs) {
  for (const auto& [first, end] : runs.ends_) add({.first = {first}, .count = end - first});
}

bool RunSet::remove(RunIndex run) {
  if (!contains(run)) return false;
  remove(RunRange{run, 1});
  return true;
}

void RunSet::remove(RunRange range) {
  auto next = ends_.upper_bound(range.first.value);
  if (next != ends_.begin()) --next;
  while (next != ends_.end() && next->first < range.end()) {
    const auto [first, end] = *next;
    if (end <= range.first.value) {
      ++next;
      continue;
    }
    next = ends_.erase(next);
    if (first < range.first.value) ends_.emplace_hint(next, first, range.first.value);
    if (range.end() < end) next = ends_.emplace_hint(next, range.end(), end);
    size_ -= std::min(end, range.end()) - std::max(first, range.first.value);
  }
}

void RunSet::remove(const RunSet& runs) {
  for (const auto& [first, end] : runs.ends_) remove({.first = {first}, .count = end - first});
}

RunSet RunSet::take_first(std::uint64_t count_max) {
  RunSet taken;
  while (taken.size() < count_max && !empty()) {
    const auto [first, end] = *ends_.begin();
    const RunRange part{{first}, std::min(count_max - taken.size(), end - first)};
    taken.add(part);
    remove(part);
  }
  return taken;
}

bool RunSet::contains(RunIndex run) const {
  const auto next = ends_.upper_bound(run.value);
  return next != ends_.begin() && run.value < std::prev(next)->second;
}

RunSet RunSet::take_last(std::uint64_t count) {
  PROOFMASS_EXPECT(count <= size_);
  RunSet taken;
  while (taken.size() < count) {
    const auto [first, end] = *std::prev(ends_.end());
    const std::uint64_t part = std::min(count - taken.size(), end - first);
    taken.add({.first = {end - part}, .count = part});
    remove({.first = {end - part}, .count = part});
  }
  return taken;
}

RunSet RunSet::overlap(RunRange range) const {
  RunSet overlap;
  auto next = ends_.upper_bound(range.first.value);
  if (next != ends_.begin()) --next;
  for (; next != ends_.end() && next->first < range.end(); ++next) {
    const std::uint64_t first = std::max(next->first, range.first.value);
    const std::uint64_t end = std::min(next->second, range.end());
    if (first < end) overlap.add({.first = {first}, .count = end - first});
  }
  return overlap;
}

RunSet RunSet::overlap(const RunSet& runs) const {
  RunSet common;
  const RunSet& fewer = num_ranges() < runs.num_ranges() ? *this : runs;
  const RunSet& more = &fewer == this ? runs : *this;
  for (const auto& [first, end] : fewer.ends_) {
    common.add(more.overlap(RunRange{.first = {first}, .count = end - first}));
  }
  return common;
}

std::vector<RunRange> RunSet::ranges() const {
  std::vector<RunRange> ranges;
  for (const auto& [first, end] : ends_) ranges.push_back({.first = {first}, .count = end - first});
  return ranges;
}

std::string to_text(const RunSet& runs) {
  constexpr std::size_t ranges_max = 6;
  if (runs.empty()) return "none";
  std::string text;
  std::size_t count = 0;
  for (const RunRange& range : runs.ranges()) {
    if (!text.empty()) text += ',';
    if (count++ == ranges_max) return text + "...";
    text += range.count == 1 ? fmt::format("{}", range.first.value)
                             : fmt::format("{}..{}", range.first.value, range.end() - 1);
  }
  return text;
}

void LeaseIndex::add(RunRange runs, LeaseId lease) {
  const std::uint64_t num_before = runs_.size();
  runs_.add(runs);
  PROOFMASS_EXPECT(runs_.size() - num_before == runs.count);
  leases_.emplace(runs.first.value, lease);
}

void LeaseIndex::remove(RunRange runs) {
  // Of a lease that goes on behind the range, the next run is the first now.
  if (const auto behind = find({runs.end()})) leases_.emplace(runs.end(), *behind);
  leases_.erase(leases_.lower_bound(runs.first.value), leases_.lower_bound(runs.end()));
  const std::uint64_t num_before = runs_.size();
  runs_.remove(runs);
  PROOFMASS_EXPECT(num_before - runs_.size() == runs.count);
}

std::optional<LeaseId> LeaseIndex::find(RunIndex run) const {
  if (!runs_.contains(run)) return std::nullopt;
  return std::prev(leases_.upper_bound(run.value))->second;
}

}  // namespace proofmass::coordinator
