#include "coordinator/archive/replay.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <future>
#include <iterator>
#include <memory>
#include <optional>
#include <span>
#include <utility>

#include "coordinator/archive/export.hpp"
#include "coordinator/archive/stored_campaign.hpp"
#include "coordinator/archive/verification.hpp"
#include "coordinator/report/review.hpp"
#include "core/campaign/recording.hpp"
#include "core/campaign/result_columns.hpp"
#include "core/model.hpp"
#include "core/runs.hpp"

namespace proofmass::coordinator {
namespace {

void require_model_of_this_program(const Store& store) {
  const std::string stored = store.model_version();
  const Model& model = store.model();
  if (!model.can_simulate()) {
    throw ArchiveError(fmt::format("model = {} ({})", stored, model.why_no_runs()));
  }
  if (stored == model.version()) return;
  throw ArchiveError(
      fmt::format("model_version = {} (must be {}, the model of this program: others compute other "
                  "bits)",
                  stored, model.version()));
}

bool is_among(const std::vector<RunRange>& ranges, RunIndex run) {
  return std::ranges::any_of(ranges, [run](const RunRange& range) {
    return range.first <= run && run.value < range.end();
  });
}

}  // namespace

Replay::Replay(const Store& store) : store_(store) {
  require_model_of_this_program(store);
  campaign_ = stored_campaign(store);
  plan_ = campaign_->prepare();
}

RunResult Replay::stored_result(RunIndex run) const {
  if (run.value >= campaign_->num_runs) {
    throw InvalidArgument(fmt::format("run = {} (must be below {}, the number of runs)", run.value,
                                      campaign_->num_runs));
  }
  if (std::optional<RunResult> result = store_.results(RunRange{run, 1}).next()) return *result;
  const bool is_given_up = is_among(store_.given_up_runs(), run);
  throw ArchiveError(fmt::format(
      "run = {} ({})", run.value,
      is_given_up ? "has no result: it was given up after it had crashed" : "has no result yet"));
}

std::vector<RunResult> Replay::worst_results(std::size_t count, const HeedStop& heed_stop) const {
  const std::vector<double> objectives = campaign_->objectives();
  if (std::ranges::none_of(objectives, [](double limit) { return std::isfinite(limit); })) {
    throw ArchiveError("no run is the worst: the errors of this campaign have no objectives");
  }
  std::vector<RunValue> worst;
  (void)walk_results(store_, heed_stop, [&](const RunResult& result) {
    if (!result.is_completed()) return;
    keep_largest({result.run, largest_ratio(result, objectives)}, count, worst);
  });
  if (worst.empty()) throw ArchiveError("runs with an estimate = 0 (must be 1 at least)");
  std::vector<RunResult> results;
  for (const RunValue& of : worst) results.push_back(stored_result(of.run));
  return results;
}

std::vector<ResultDifference> Replay::run(const RunResult& stored, SeriesOutput* output,
                                          const HeedStop& heed_stop) const {
  const SampleSink pass_on = [&](const RecordedSample& sample) {
    if (output != nullptr) output->add(sample);
  };
  const RunResult computed = plan_->replay({stored.run, campaign_->table_values(stored.run)},
                                           pass_on, [&](int /*num_steps*/) { heed_stop(); });
  std::vector<ResultDifference> differences = differences_of(stored, computed, store_.schema());
  if (!differences.empty() || output == nullptr) return differences;
  if (stored.status == RunStatus::no_draw) {
    throw ArchiveError(fmt::format(
        "run = {} (has no accepted draw: nothing is simulated, and there are no series)",
        stored.run.value));
  }
  heed_stop();
  output->finish();
  return differences;
}

namespace {

/// Calls work(i) for each i below `count`, in several threads. Throws what one of them threw; then
/// no further work is begun.
void in_threads(std::size_t count, std::size_t num_threads,
                const std::function<void(std::size_t)>& work) {
  std::atomic<std::size_t> next = 0;
  const auto work_on = [&] {
    try {
      for (std::size_t i = next++; i < count; i = next++) work(i);
    } catch (...) {
      next = count;
      throw;
    }
  };
  std::vector<std::future<void>> others;  // Each waits for its thread when it is destroyed.
  for (std::size_t i = 1; i < std::min(num_threads, count); ++i) {
    others.push_back(std::async(std::launch::async, work_on));
  }
  work_on();
  for (std::future<void>& other : others) other.get();
}

constexpr std::size_t num_at_a_time = 8192;

/// The first difference of a run, in words; empty if there is none.
std::string difference_of(const Campaign& campaign, const ResultSchema& schema,
                          const RunResult& stored) {
  const RunDraw draw = campaign.draw(stored.run);
  if (draw.truth.empty() || draw.num_draws != stored.num_draws) {
    return fmt::format("run {}: num_draws = {} (must be {})", stored.run.value, stored.num_draws,
                       draw.num_draws);
  }
  for (std::size_t i = 0; i < draw.truth.size(); ++i) {
    if (have_same_bits(stored.truth[i], draw.truth[i])) continue;
    return fmt::format("run {}: truth_{} = {} (must be {})", stored.run.value,
                       schema.quantities[i].column(), stored.truth[i], draw.truth[i]);
  }
  return "";
}

}  // namespace

std::vector<RunIndex> chosen_runs(std::span<const RunRange> runs, double fraction) {
  const std::uint64_t num_runs = num_runs_in(runs);
  if (num_runs == 0) return {};
  const auto wanted =
      static_cast<std::uint64_t>(std::ceil(fraction * static_cast<double>(num_runs)));
  std::vector<RunIndex> chosen(std::clamp(wanted, std::uint64_t{1}, num_runs));
  std::uint64_t num_before = 0;  // Runs in the ranges before the first one.
  for (std::uint64_t i = 0; i < chosen.size(); ++i) {
    const std::uint64_t place = (2 * i + 1) * num_runs / (2 * chosen.size());
    for (; place - num_before >= runs.front().count; runs = runs.subspan(1)) {
      num_before += runs.front().count;
    }
    chosen[i] = {runs.front().first.value + (place - num_before)};
  }
  return chosen;
}

std::vector<ResultDifference> differences_of(const RunResult& stored, const RunResult& computed,
                                             const ResultSchema& schema) {
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
  for (const ValueColumn& column : value_columns(schema)) {
    if (column.kind == ValueKind::error) continue;  // It follows from the others.
    const std::optional<double> a = column.value_in(stored), b = column.value_in(computed);
    // A run without a draw has no health.
    if (!a || !b || have_same_bits(*a, *b)) continue;
    differ(column.name, fmt::format("{}", *a), fmt::format("{}", *b));
  }
  if (stored.correlations != computed.correlations) {
    differ("correlations", fmt::format("[{}]", fmt::join(stored.correlations, ",")),
           fmt::format("[{}]", fmt::join(computed.correlations, ",")));
  }
  if (!(stored.loss == computed.loss)) {
    differ("loss_cause", loss_text(schema, stored.loss), loss_text(schema, computed.loss));
  }
  return differences;
}

std::vector<ResultDifference> simulate_again(const Campaign& campaign,
                                             std::span<const RunResult> stored,
                                             std::size_t num_threads, const HeedStop& heed_stop) {
  const std::unique_ptr<const Plan> plan = campaign.prepare();
  const ResultSchema schema = campaign.results();
  const std::size_t batch_size = campaign.model().batch_size();
  std::vector<std::vector<ResultDifference>> found((stored.size() + batch_size - 1) / batch_size);
  in_threads(found.size(), num_threads, [&](std::size_t i) {
    const std::size_t first = i * batch_size;
    const auto batch = stored.subspan(first, std::min(batch_size, stored.size() - first));
    std::vector<RunRequest> requests;
    for (const RunResult& result : batch) {
      requests.push_back({result.run, campaign.table_values(result.run)});
    }
    const auto on_progress = [&](int /*num_steps*/) { heed_stop(); };
    const std::vector<RunResult> computed =
        plan->simulate_batch(requests, best_instruction_set(), on_progress);
    for (std::size_t k = 0; k < batch.size(); ++k) {
      std::ranges::move(differences_of(batch[k], computed[k], schema),
                        std::back_inserter(found[i]));
    }
  });
  std::vector<ResultDifference> differences;
  for (auto& of_batch : found) std::ranges::move(of_batch, std::back_inserter(differences));
  return differences;
}

Redraw redraw_runs(const Store& store, const Campaign& campaign, std::size_t num_threads,
                   const HeedStop& heed_stop) {
  Redraw redraw;
  std::vector<RunResult> results;
  const auto compare = [&] {
    heed_stop();
    redraw.num_drawn += results.size();
    std::vector<std::string> differences(results.size());
    in_threads(results.size(), num_threads, [&](std::size_t i) {
      differences[i] = difference_of(campaign, store.schema(), results[i]);
    });
    for (const std::string& difference : differences) {
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
