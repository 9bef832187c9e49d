#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "coordinator/report/json.hpp"
#include "coordinator/report/read_results.hpp"
#include "coordinator/report/report.hpp"
#include "coordinator/report/standard_errors.hpp"
#include "coordinator/table/table.hpp"

namespace proofmass::coordinator {

RunningReplicates::RunningReplicates(const ResultSchema& schema, std::vector<double> objectives,
                                     const SamplingDesign& design)
    : objectives_(std::move(objectives)), groups_(design.points), quantities_(objectives_.size()) {
  counts_.design = design;
  std::size_t num_standard_errors = 0;
  for (std::size_t i = 0; i < quantities_.size(); ++i) {
    if (schema.quantities[i].has_standard_error) quantities_[i].position = num_standard_errors++;
  }
}

void RunningReplicates::add(const RunResult& result) {
  const std::span<const RunResult> runs = groups_.add(result);
  if (runs.empty()) return;
  const std::uint64_t num_estimated = count_of(runs, &RunResult::is_completed);
  ++counts_.num_replicates;
  counts_.num_estimated += num_estimated;
  counts_.num_drawn_again += count_of(runs, [](const auto& run) { return run.num_draws > 1; });
  std::vector<bool> is_within(runs.size(), true);
  for (std::size_t i = 0; i < quantities_.size(); ++i) {
    Quantity& quantity = quantities_[i];
    double magnitude = 0.0, bias = 0.0, mean_square = 0.0, beyond = 0.0, covered = 0.0;
    for (std::size_t k = 0; k < runs.size(); ++k) {
      const RunResult& run = runs[k];
      const bool is_run_beyond = is_beyond(run, i, objectives_[i]);
      is_within[k] = is_within[k] && !is_run_beyond;
      beyond += is_run_beyond ? 1.0 : 0.0;
      if (!run.is_completed()) continue;
      const double error = run.error(i);
      magnitude += std::abs(error);
      bias += error;
      mean_square += error * error;
      if (run.standard_error.empty() || !quantity.position) continue;
      have_standard_errors_ = true;
      covered += std::abs(error) < normal_95 * run.standard_error[*quantity.position] ? 1.0 : 0.0;
    }
    quantity.beyond.add(beyond, runs.size());
    if (num_estimated == 0) continue;
    quantity.magnitude.add(magnitude, num_estimated);
    quantity.bias.add(bias, num_estimated);
    quantity.mean_square.add(mean_square, num_estimated);
    quantity.covered.add(covered, num_estimated);
  }
  within_.add(static_cast<double>(std::ranges::count(is_within, true)), runs.size());
}

void RunningReplicates::Mean::add(double sum, std::uint64_t num_runs) {
  total += sum;
  const double mean = sum / static_cast<double>(num_runs);
  if (!means) means.emplace(mean);
  means->add(mean);
}

ReplicatedMean RunningReplicates::Mean::mean() const {
  if (!means) return {};
  const Moments moments = means->moments();
  ReplicatedMean of{.mean = moments.mean};
  if (moments.count < num_replicates_of_interval) return of;
  of.interval = mean_interval(moments, default_confidence);
  of.is_too_skewed = is_too_skewed(moments.skewness, moments.count);
  return of;
}

ReplicatedMean RunningReplicates::Mean::share(std::uint64_t num_runs) const {
  ReplicatedMean of = mean();
  if (!of.interval) return of;
  const double fewest = std::min(total, static_cast<double>(num_runs) - total);
  // A share that follows a single quantity may be the same in nearly all replicates. Their scatter
  // says nothing then, as the shares are whole numbers of runs and the true one is not.
  const Moments shares = means->moments();
  const double scatter =
      shares.standard_deviation * static_cast<double>(num_runs) / static_cast<double>(shares.count);
  if (fewest < static_cast<double>(num_hits_of_interval) || scatter < count_deviation_min) {
    of.interval.reset();
    return of;
  }
  of.interval->lower = std::max(of.interval->lower, 0.0);
  of.interval->upper = std::min(of.interval->upper, 1.0);
  return of;
}

ReplicateStatistics RunningReplicates::statistics() {
  ReplicateStatistics statistics = counts_;
  constexpr std::size_t num_named = 5;
  statistics.incomplete = groups_.incomplete();
  statistics.num_incomplete = statistics.incomplete.size();
  statistics.incomplete.resize(std::min(statistics.incomplete.size(), num_named));
  const std::uint64_t num_runs = statistics.num_replicates * statistics.design.points;
  statistics.within_objectives = within_.share(num_runs);
  if (statistics.num_estimated == 0) return statistics;
  for (std::size_t i = 0; i < quantities_.size(); ++i) {
    const Quantity& quantity = quantities_[i];
    ReplicatedQuantity of{.magnitude = quantity.magnitude.mean(),
                          .bias = quantity.bias.mean(),
                          .mean_square = quantity.mean_square.mean()};
    if (std::isfinite(objectives_[i])) of.beyond = quantity.beyond.share(num_runs);
    if (have_standard_errors_ && quantity.position) {
      of.covered = quantity.covered.share(statistics.num_estimated);
    }
    statistics.quantities.push_back(std::move(of));
  }
  return statistics;
}

namespace {

/// Of the root of a mean square, whose interval may begin below 0.
std::optional<Interval> root_of(std::optional<Interval> interval) {
  if (!interval) return interval;
  interval->lower = std::sqrt(std::max(interval->lower, 0.0));
  interval->upper = std::sqrt(interval->upper);
  return interval;
}

std::vector<std::string> replicate_notes(const ResultSchema& schema,
                                         const ReplicateStatistics& statistics) {
  std::vector<std::string> notes{fmt::format(
      "{} complete replicates of {} runs (campaign.design = \"{}\"); their means, which "
      "are independent, make the intervals",
      statistics.num_replicates, statistics.design.points, name_of(statistics.design.kind))};
  if (statistics.num_incomplete > 0) {
    notes.push_back(
        fmt::format("left out, as a run is not finished yet: replicate {}{}",
                    fmt::join(statistics.incomplete, ", "),
                    statistics.num_incomplete > statistics.incomplete.size()
                        ? fmt::format(" and others, {} in all", statistics.num_incomplete)
                        : std::string()));
  }
  notes.emplace_back("each interval holds by itself: of 20, one misses the true value");
  const std::string skewed = symbols_of(schema, [&](std::size_t i) {
    const ReplicatedQuantity& of = statistics.quantities[i];
    return of.magnitude.is_too_skewed || of.bias.is_too_skewed || of.mean_square.is_too_skewed;
  });
  if (!skewed.empty()) {
    notes.push_back(
        fmt::format("too skewed for intervals from {} replicates, which may cover less than 95 %: "
                    "{}",
                    statistics.num_replicates, skewed));
  }
  notes.emplace_back("beyond: runs whose error exceeds the objective, or without an estimate");
  if (const std::uint64_t num_runs = statistics.num_replicates * statistics.design.points;
      statistics.num_estimated < num_runs) {
    const std::uint64_t num_without = num_runs - statistics.num_estimated;
    notes.push_back(fmt::format("{} without an estimate {} left out of the means of {}",
                                counted(num_without, "run"), num_without == 1 ? "is" : "are",
                                num_without == 1 ? "its replicate" : "their replicates"));
  }
  if (statistics.num_drawn_again > 0) {
    notes.push_back(
        fmt::format("{} runs are not at their points: a draw that is not accepted is replaced by "
                    "an independent one",
                    statistics.num_drawn_again));
  }
  if (statistics.num_replicates < num_replicates_of_interval) {
    notes.push_back(fmt::format("an interval needs {} replicates", num_replicates_of_interval));
  }
  const ReplicatedMean& within = statistics.within_objectives;
  if (std::ranges::any_of(statistics.quantities,
                          [](const auto& of) { return of.beyond.has_value(); })) {
    notes.push_back(fmt::format("all objectives: {:.3g} % of all runs{}", 100.0 * within.mean,
                                within.interval ? fmt::format(", {:.3g} to {:.3g} % of all draws",
                                                              100.0 * within.interval->lower,
                                                              100.0 * within.interval->upper)
                                                : std::string()));
  }
  notes.push_back(
      fmt::format("the interval of a share needs {} runs on each side, and replicates that differ; "
                  "worst, percentiles and verdicts need independent runs",
                  num_hits_of_interval));
  notes.emplace_back(
      "a design needs no fewer runs than independent draws times the share of noise in the "
      "variance; "
      "campaign.realisations measures that share");
  return notes;
}

}  // namespace

Table replicate_table(const ResultSchema& schema, const ReplicateStatistics& statistics) {
  if (statistics.quantities.empty()) return {};
  constexpr const char* magnitude = "mean of |error|";
  constexpr const char* bias = "bias";
  constexpr const char* rms = "rms of the error";
  constexpr const char* beyond = "beyond, %";
  Table table{.id = "replicate-table",
              .caption = "95 % intervals from replicates of the design, in the units above",
              .rows = std::vector<Row>(statistics.quantities.size()),
              .notes = replicate_notes(schema, statistics)};
  const std::vector<ReplicatedQuantity>& all = statistics.quantities;
  const auto scale = [&](std::size_t i) { return schema.quantities[i].display_scale; };
  add_column(table, {"parameter", true, 10}, [&](auto i) { return schema.quantities[i].symbol; });
  add_ends(table, {"from", false, 8, magnitude}, {"to", false, 8, magnitude}, [&](auto i) {
    return IntervalAndScale(not_negative(all[i].magnitude.interval), scale(i));
  });
  add_ends(table, {"from", false, 9, bias, true}, {"to", false, 9, bias},
           [&](auto i) { return IntervalAndScale(all[i].bias.interval, scale(i)); });
  add_ends(table, {"from", false, 8, rms, true}, {"to", false, 9, rms}, [&](auto i) {
    return IntervalAndScale(root_of(all[i].mean_square.interval), scale(i));
  });
  add_ends(table, {"from", false, 8, beyond, true}, {"to", false, 8, beyond}, [&](auto i) {
    const auto& share = all[i].beyond;
    return IntervalAndScale(share ? share->interval : std::nullopt, percent_scale);
  });
  return table;
}

// The library finds it by its argument, and would not in an unnamed namespace.
static void to_json(Json& json, const ReplicatedMean& of) {
  json = {{"mean", of.mean}, {"interval", of.interval}};
}

Json json_of(const ResultSchema& schema, const ReplicateStatistics& statistics) {
  Json json{{"design", name_of(statistics.design.kind)},
            {"points", statistics.design.points},
            {"num_replicates", statistics.num_replicates},
            {"num_incomplete", statistics.num_incomplete},
            {"first_incomplete", statistics.incomplete},
            {"num_estimated", statistics.num_estimated},
            {"num_drawn_again", statistics.num_drawn_again},
            {"within_objectives", statistics.within_objectives},
            {"parameters", Json::array()}};
  for (std::size_t i = 0; i < statistics.quantities.size(); ++i) {
    const ReplicatedQuantity& of = statistics.quantities[i];
    json["parameters"].push_back({{"parameter", schema.quantities[i].name},
                                  {"magnitude", of.magnitude},
                                  {"bias", of.bias},
                                  {"mean_square", of.mean_square},
                                  {"beyond", of.beyond},
                                  {"covered", of.covered}});
  }
  return json;
}

}  // namespace proofmass::coordinator
