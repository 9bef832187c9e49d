#include "core/statistics/order_selection.hpp"

#include <algorithm>
#include <bit>
#include <numeric>
#include <utility>

namespace proofmass {
namespace {

constexpr int num_bits = 64;
constexpr int num_first_bits = 20;
constexpr int num_further_bits = 12;
constexpr std::uint64_t sign_bit = std::uint64_t{1} << 63;

/// Position of a value among all doubles: ascending as the values are. Zeros have no sign.
std::uint64_t position_of(double value) {
  const auto bits = std::bit_cast<std::uint64_t>(value + 0.0);
  return (bits & sign_bit) != 0 ? ~bits : bits | sign_bit;
}

double value_of(std::uint64_t position) {
  return std::bit_cast<double>((position & sign_bit) != 0 ? position & ~sign_bit : ~position);
}

int next_bits(int shift) { return std::min(num_further_bits, shift); }

}  // namespace

OrderSelection::OrderSelection()
    : shift_(num_bits - num_first_bits), counts_(std::size_t{1} << num_first_bits) {}

void OrderSelection::add(double value) {
  const std::uint64_t position = position_of(value);
  const std::uint64_t upper_bits = position >> shift_;
  if (is_first_) {
    ++counts_[upper_bits];
    return;
  }
  const auto found = std::ranges::lower_bound(bins_, upper_bits, {}, &Bin::upper_bits);
  if (found == bins_.end() || found->upper_bits != upper_bits) return;
  if (found->is_kept) {
    found->values.push_back(value);
    return;
  }
  const int num_next = next_bits(shift_);
  const std::uint64_t mask = (std::uint64_t{1} << num_next) - 1;
  ++found->counts[(position >> (shift_ - num_next)) & mask];
}

bool OrderSelection::end_first_pass(const std::set<std::size_t>& places) {
  is_first_ = false;
  const Bin all{.places = {places.begin(), places.end()}, .values = {}, .counts = {}};
  std::vector<Bin> bins;
  split(all, counts_, num_first_bits, bins);
  counts_ = {};
  begin_pass(std::move(bins));
  return !bins_.empty();
}

bool OrderSelection::end_pass() {
  std::vector<Bin> bins;
  const int num_next = next_bits(shift_);
  for (Bin& bin : bins_) {
    if (!bin.is_kept) {
      split(bin, bin.counts, num_next, bins);
      continue;
    }
    std::ranges::sort(bin.values);
    for (const std::size_t place : bin.places) values_[place] = bin.values[place - bin.num_below];
  }
  shift_ -= num_next;
  begin_pass(std::move(bins));
  return !bins_.empty();
}

/// Adds the bins of a finer division in which a bin's places lie.
void OrderSelection::split(const Bin& parent, std::span<const std::uint32_t> counts,
                           int num_next_bits, std::vector<Bin>& bins) {
  auto place = parent.places.begin();
  std::uint64_t num_below = parent.num_below;
  for (std::size_t i = 0; i < counts.size() && place != parent.places.end(); ++i) {
    const std::uint64_t end = num_below + counts[i];
    Bin bin{.upper_bits = (parent.upper_bits << num_next_bits) | i,
            .num_below = num_below,
            .count = counts[i],
            .places = {},
            .values = {},
            .counts = {}};
    while (place != parent.places.end() && *place < end) bin.places.push_back(*place++);
    num_below = end;
    if (!bin.places.empty()) bins.push_back(std::move(bin));
  }
}

/// Decides for each bin what the next pass does with its values: the smallest ones are kept.
void OrderSelection::begin_pass(std::vector<Bin> bins) {
  bins_ = std::move(bins);
  if (shift_ == 0) {  // All bits are known.
    for (const Bin& bin : bins_) {
      for (const std::size_t place : bin.places) values_[place] = value_of(bin.upper_bits);
    }
    bins_.clear();
    return;
  }
  std::vector<Bin*> by_count;
  for (Bin& bin : bins_) by_count.push_back(&bin);
  std::ranges::stable_sort(by_count, {}, [](const Bin* bin) { return bin->count; });
  std::uint64_t num_kept = 0;
  for (Bin* const bin : by_count) {
    num_kept += bin->count;
    bin->is_kept = num_kept <= num_selected_max;
    if (bin->is_kept) {
      bin->values.reserve(bin->count);
    } else {
      bin->counts.resize(std::size_t{1} << next_bits(shift_));
    }
  }
}

}  // namespace proofmass
