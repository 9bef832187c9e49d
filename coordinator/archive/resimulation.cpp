#include "coordinator/archive/resimulation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <exception>
#include <mutex>
#include <optional>
#include <span>
#include <thread>
#include <utility>

#include "coordinator/archive/result_columns.hpp"
#include "coordinator/archive/verification.hpp"
#include "core/model.hpp"
#include "core/runs.hpp"

namespace proofmass::coordinator {
namespace {

/// Threads that simulate batches of a campaign until there are none left.
class Simulation {
 public:
  Simulation(const Campaign& campaign, std::span<const RunResult> stored,
             const IsStopped& is_stopped)
      : campaign_(campaign), stored_(stored), is_stopped_(is_stopped), plan_(campaign.prepare()) {}

  std::vector<ResultDifference> run(std::size_t num_threads) {
    const std::size_t num_batches = (stored_.size() + batch_size_ - 1) / batch_size_;
    std::vector<std::jthread> others;
    for (std::size_t i = 1; i < std::min(num_threads, num_batches); ++i) {
      others.emplace_back([this] { simulate_batches(); });
    }
    simulate_batches();
    for (std::jthread& other : others) other.join();
    if (failure_) std::rethrow_exception(failure_);
    std::ranges::stable_sort(differences_, {}, &ResultDifference::run);
    return std::move(differences_);
  }

 private:
  void simulate_batches() {
    try {
      while (!has_failed_) {
        const std::size_t first = next_.fetch_add(batch_size_);
        if (first >= stored_.size()) return;
        const std::size_t count = std::min(batch_size_, stored_.size() - first);
        simulate(stored_.subspan(first, count));
      }
    } catch (...) {
      fail(std::current_exception());
    }
  }

  void simulate(std::span<const RunResult> batch) {
    std::vector<RunRequest> requests;
    for (const RunResult& result : batch) {
      requests.push_back({result.run, campaign_.table_values(result.run)});
    }
    const auto on_progress = [&](int /*num_steps*/) {
      if (has_failed_ || is_stopped_()) throw Interrupted();
    };
    const std::vector<RunResult> computed =
        plan_->simulate_batch(requests, best_instruction_set(), on_progress);
    for (std::size_t i = 0; i < batch.size(); ++i) keep(differences_of(batch[i], computed[i]));
  }

  /// Of several threads' failures the first counts: the others may follow from it.
  void fail(std::exception_ptr failure) {
    const std::lock_guard lock(mutex_);
    if (!failure_) failure_ = std::move(failure);
    has_failed_ = true;
  }

  void keep(const std::vector<ResultDifference>& differences) {
    const std::lock_guard lock(mutex_);
    differences_.insert(differences_.end(), differences.begin(), differences.end());
  }

  const Campaign& campaign_;
  std::span<const RunResult> stored_;
  const IsStopped& is_stopped_;
  std::unique_ptr<const Plan> plan_;
  std::size_t batch_size_ = model().batch_size();
  std::atomic<std::size_t> next_ = 0;
  std::atomic<bool> has_failed_ = false;
  std::mutex mutex_;  ///< Guards what follows.
  std::exception_ptr failure_;
  std::vector<ResultDifference> differences_;
};

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

ChosenRuns::ChosenRuns(std::span<const RunRange> runs, double fraction)
    : runs_(runs), num_runs_(num_runs_in(runs)), count_(0) {
  if (num_runs_ == 0) return;
  const double wanted = std::ceil(fraction * static_cast<double>(num_runs_));
  count_ = std::clamp(static_cast<std::uint64_t>(wanted), std::uint64_t{1}, num_runs_);
}

RunIndex ChosenRuns::next(std::uint64_t i) {
  const std::uint64_t place = (2 * i + 1) * num_runs_ / (2 * count_);
  while (place - num_before_ >= runs_.front().count) {
    num_before_ += runs_.front().count;
    runs_ = runs_.subspan(1);
  }
  return RunIndex{runs_.front().first.value + (place - num_before_)};
}

std::vector<ResultDifference> differences_of(const RunResult& stored, const RunResult& computed) {
  std::vector<ResultDifference> differences;
  const auto differ = [&](std::string column, std::string of_stored, std::string of_computed) {
    differences.push_back(
        {stored.run, std::move(column), std::move(of_stored), std::move(of_computed)});
  };
  if (stored.status != computed.status) {
    differ("status", std::string(name_of(stored.status)), std::string(name_of(computed.status)));
    return differences;
  }
  if (stored.num_draws != computed.num_draws) {
    differ("num_draws", std::to_string(stored.num_draws), std::to_string(computed.num_draws));
  }
  if (stored.num_rounds != computed.num_rounds) {
    differ("num_rounds", std::to_string(stored.num_rounds), std::to_string(computed.num_rounds));
  }
  for (const ValueColumn& column : value_columns()) {
    if (column.kind == ValueKind::error) continue;  // It follows from the others.
    const std::optional<double> a = column.value_in(stored), b = column.value_in(computed);
    // A run without a draw has no health.
    if (!a || !b || have_same_bits(*a, *b)) continue;
    differ(column.name, fmt::format("{}", *a), fmt::format("{}", *b));
  }
  if (!(stored.loss == computed.loss)) {
    const auto text_of = [](const Loss& loss) {
      return fmt::format("{} in {}", name_at(model().results().loss_causes, loss.cause),
                         name_at(model().results().loss_sessions, loss.session));
    };
    differ("loss_cause", text_of(stored.loss), text_of(computed.loss));
  }
  return differences;
}

std::vector<ResultDifference> simulate_again(const Campaign& campaign,
                                             std::span<const RunResult> stored,
                                             std::size_t num_threads, const IsStopped& is_stopped) {
  return Simulation(campaign, stored, is_stopped).run(num_threads);
}

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
