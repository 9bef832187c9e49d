#include "core/statistics/value_passes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>
#include <set>
#include <utility>

#include "core/error.hpp"

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

ValuePasses::ValuePasses(Wanted wanted, std::size_t num_kept_max)
    : wanted_(std::move(wanted)), num_kept_max_(num_kept_max) {}

void ValuePasses::add(double value) {
  if (!std::isfinite(value)) {
    throw InvalidArgument(fmt::format("values[{}] = {} (must be finite)", num_in_pass_, value));
  }
  ++num_in_pass_;
  if (num_passes_ > 0) {
    if (num_passes_ == 1) add_to_sums(value);
    if (selection_) selection_->add(value);
    return;
  }
  largest_ = count_ == 0 ? value : std::max(largest_, value);
  ++count_;
  sum_.add(value);
  if (are_kept_ && count_ <= num_kept_max_) {
    kept_.push_back(value);
    return;
  }
  if (are_kept_ && !wanted_.levels.empty()) {
    selection_.emplace();
    for (const double earlier : kept_) selection_->add(earlier);
  }
  are_kept_ = false;
  kept_ = {};
  if (selection_) selection_->add(value);
}

bool ValuePasses::end_pass() {
  if (num_in_pass_ != count_) {
    throw InvalidArgument(fmt::format("values = {} in pass {} (must be {}, as in the first)",
                                      num_in_pass_, num_passes_ + 1, count_));
  }
  num_in_pass_ = 0;
  ++num_passes_;
  if (count_ == 0) return false;
  if (num_passes_ == 1) {
    end_first_pass();
    return !are_kept_;
  }
  if (num_passes_ == 2) end_sums();
  return selection_ && selection_->end_pass();
}

void ValuePasses::end_first_pass() {
  const double mean = sum_.value() / static_cast<double>(count_);
  sums_.emplace(mean);
  if (wanted_.has_deviation_interval && count_ >= 3) groups_.emplace(count_, mean);
  find_places();
  if (!are_kept_) return;
  for (const double value : kept_) add_to_sums(value);
  end_sums();
  std::ranges::sort(kept_);
}

void ValuePasses::add_to_sums(double value) {
  sums_->add(value);
  if (groups_) groups_->add(value);
}

void ValuePasses::end_sums() {
  moments_ = sums_->moments();
  if (groups_) deviation_interval_ = groups_->deviation_interval(default_confidence);
}

void ValuePasses::find_places() {
  std::set<std::size_t> wanted;
  const auto want = [&](const OrderPlace& place) { wanted.insert({place.from, place.to}); };
  for (const double level : wanted_.levels) {
    const Places places{.value = percentile_place(count_, level),
                        .interval = percentile_interval_places(count_, level, default_confidence)};
    want(places.value);
    if (places.interval) {
      want(places.interval->lower);
      want(places.interval->upper);
    }
    places_.emplace(level, places);
  }
  if (selection_) (void)selection_->end_first_pass(wanted);
}

double ValuePasses::value_at(const OrderPlace& place) const {
  const auto at = [&](std::size_t index) {
    return are_kept_ ? kept_[index] : selection_->value_at(index);
  };
  return place.between(at(place.from), at(place.to));
}

double ValuePasses::percentile(double level) const { return value_at(places_.at(level).value); }

std::optional<Interval> ValuePasses::percentile_interval(double level) const {
  const std::optional<IntervalPlaces>& places = places_.at(level).interval;
  if (!places) return std::nullopt;
  return Interval{value_at(places->lower), value_at(places->upper), default_confidence};
}

}  // namespace proofmass
