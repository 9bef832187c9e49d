#include "coordinator/archive/redraw.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <exception>
#include <optional>
#include <span>
#include <thread>

#include "coordinator/archive/result_columns.hpp"
#include "coordinator/archive/verification.hpp"

namespace proofmass::coordinator {
namespace {

constexpr std::size_t num_at_a_time = 8192;

/// The first difference of a run, in words; empty if there is none.
std::string difference_of(const Campaign& campaign, const RunResult& stored) {
  const RunDraw draw = campaign.draw(stored.run);
  if (draw.truth.empty() || draw.num_draws != stored.num_draws) {
    return fmt::format("run {}: num_draws = {} (must be {})", stored.run.value, stored.num_draws,
                       draw.num_draws);
  }
  for (const ValueColumn& column : value_columns()) {
    if (column.kind != ValueKind::truth) continue;
    const std::size_t i = column.index;
    if (have_same_bits(stored.truth[i], draw.truth[i])) continue;
    return fmt::format("run {}: {} = {} (must be {})", stored.run.value, column.name,
                       stored.truth[i], draw.truth[i]);
  }
  return "";
}

/// Differences of some runs, each on its place.
class Part {
 public:
  Part(const Campaign& campaign, std::span<const RunResult> results)
      : campaign_(campaign), results_(results), differences_(results.size()) {}

  void compute(std::size_t first, std::size_t step) {
    try {
      for (std::size_t i = first; i < results_.size(); i += step) {
        differences_[i] = difference_of(campaign_, results_[i]);
      }
    } catch (...) {
      failures_[first] = std::current_exception();
    }
  }

  std::vector<std::string> compute_all(std::size_t num_threads) {
    failures_.resize(num_threads);
    {
      std::vector<std::jthread> others;
      for (std::size_t i = 1; i < num_threads; ++i) {
        others.emplace_back([this, i, num_threads] { compute(i, num_threads); });
      }
      compute(0, num_threads);
    }
    for (const std::exception_ptr& failure : failures_) {
      if (failure) std::rethrow_exception(failure);
    }
    return std::move(differences_);
  }

 private:
  const Campaign& campaign_;
  std::span<const RunResult> results_;
  std::vector<std::string> differences_;
  std::vector<std::exception_ptr> failures_;
};

}  // namespace

Redraw redraw_runs(const Store& store, const Campaign& campaign, std::size_t num_threads,
                   const IsStopped& is_stopped) {
  Redraw redraw;
  std::vector<RunResult> results;
  const auto compare = [&] {
    if (is_stopped()) throw Interrupted();
    redraw.num_drawn += results.size();
    for (const std::string& difference : Part(campaign, results).compute_all(num_threads)) {
      if (difference.empty()) continue;
      ++redraw.num_different;
      if (redraw.differences.size() < details_named_max) redraw.differences.push_back(difference);
    }
    results.clear();
  };
  store.for_each_result([&](const RunResult& result) {
    if (result.has_truth()) results.push_back(result);
    if (results.size() == num_at_a_time) compare();
  });
  compare();
  return redraw;
}

}  // namespace proofmass::coordinator
