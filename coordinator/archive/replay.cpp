#include "coordinator/archive/replay.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <utility>

#include "coordinator/archive/export.hpp"
#include "coordinator/archive/stored_campaign.hpp"
#include "core/campaign/recording.hpp"
#include "core/model.hpp"

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

/// Largest |error| / objective of a result with an estimate.
double largest_ratio(const RunResult& result, std::span<const double> objectives) {
  double largest = 0.0;
  for (std::size_t i = 0; i < objectives.size(); ++i) {
    largest = std::max(largest, std::abs(result.error(i)) / objectives[i]);
  }
  return largest;
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

std::vector<RunResult> Replay::worst_results(std::size_t count, const IsStopped& is_stopped) const {
  const std::vector<double> objectives = campaign_->objectives();
  if (std::ranges::none_of(objectives, [](double limit) { return std::isfinite(limit); })) {
    throw ArchiveError("no run is the worst: the errors of this campaign have no objectives");
  }
  std::vector<std::pair<double, RunResult>> worst;  // Largest ratio first, then by run.
  (void)walk_results(store_, is_stopped, [&](const RunResult& result) {
    if (!result.is_completed()) return;
    const double ratio = largest_ratio(result, objectives);
    if (worst.size() == count && ratio <= worst.back().first) return;
    const auto place = std::ranges::upper_bound(worst, ratio, std::greater<>(),
                                                &std::pair<double, RunResult>::first);
    worst.emplace(place, ratio, result);
    if (worst.size() > count) worst.pop_back();
  });
  if (worst.empty()) throw ArchiveError("runs with an estimate = 0 (must be 1 at least)");
  std::vector<RunResult> results;
  for (auto& [ratio, result] : worst) results.push_back(std::move(result));
  return results;
}

std::vector<ResultDifference> Replay::run(const RunResult& stored, SeriesOutput* output,
                                          const IsStopped& is_stopped) const {
  const SampleSink pass_on = [&](const RecordedSample& sample) {
    if (output != nullptr) output->add(sample);
  };
  const auto stop_if_asked = [&](int /*num_steps*/) {
    if (is_stopped()) throw Interrupted();
  };
  const RunResult computed =
      plan_->replay({stored.run, campaign_->table_values(stored.run)}, pass_on, stop_if_asked);
  std::vector<ResultDifference> differences = differences_of(stored, computed, store_.schema());
  if (!differences.empty() || output == nullptr) return differences;
  if (stored.status == RunStatus::no_draw) {
    throw ArchiveError(fmt::format(
        "run = {} (has no accepted draw: nothing is simulated, and there are no series)",
        stored.run.value));
  }
  stop_if_asked(0);
  output->finish();
  return differences;
}

}  // namespace proofmass::coordinator
