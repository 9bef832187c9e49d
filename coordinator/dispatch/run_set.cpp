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

bool RunSet::remove(RunIndex run) {
  auto found = ends_.upper_bound(run.value);
  if (found == ends_.begin()) return false;
  --found;
  const auto [first, end] = *found;
  if (run.value >= end) return false;
  ends_.erase(found);
  if (first < run.value) ends_.emplace(first, run.value);
  if (run.value + 1 < end) ends_.emplace(run.value + 1, end);
  --size_;
  return true;
}

RunRange RunSet::take_first(std::uint64_t count_max) {
  PROOFMASS_EXPECT(!empty() && count_max > 0);
  const auto [first, end] = *ends_.begin();
  const std::uint64_t count = std::min(count_max, end - first);
  ends_.erase(ends_.begin());
  if (first + count < end) ends_.emplace(first + count, end);
  size_ -= count;
  return {.first = {first}, .count = count};
}

bool RunSet::contains(RunIndex run) const {
  const auto next = ends_.upper_bound(run.value);
  return next != ends_.begin() && run.value < std::prev(next)->second;
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

}  // namespace proofmass::coordinator
