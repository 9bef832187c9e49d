#include "core/statistics/value_passes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "core/error.hpp"

namespace proofmass {

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
