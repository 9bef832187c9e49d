#include "coordinator/report/read_results.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <optional>
#include <string_view>
#include <utility>

#include "coordinator/table/table.hpp"
#include "core/campaign/independence.hpp"
#include "core/runs.hpp"
#include "core/statistics/order.hpp"

namespace proofmass::coordinator {
namespace {

// A run that is given up is one of those that lack a result, and as many as were counted with the
// statistics.
void check_given_up(const Store& store, const ReadResults& results) {
  const std::uint64_t num_given_up = results.missing.num_given_up;
  const std::optional<Summary> summary = store.summary();
  if (summary && summary->num_finished == results.statistics.num_runs &&
      num_given_up < summary->num_given_up) {
    store.refuse_as_damaged(fmt::format("{} runs are given up, and its statistics are beside {}",
                                        num_given_up, summary->num_given_up));
  }
}

// Results never change: as many of them are the same ones.
bool are_current(const Store& store) {
  const std::optional<Summary> summary = store.summary();
  return summary && summary->num_finished == num_runs_in(store.finished_runs()) &&
         summary->num_given_up == num_runs_in(store.given_up_runs());
}

/// Doubles that are kept while results are read, 128 MB.
constexpr std::size_t num_kept_max = std::size_t{1} << 24;

/// estimate − truth of the first quantities, of all of them while results are few.
class KeptErrors {
 public:
  explicit KeptErrors(std::size_t num_quantities) : columns_(num_quantities) {}

  void add(const RunResult& result) {
    if (!result.is_completed()) return;
    ++num_runs_;
    while (columns_.size() * num_runs_ > num_kept_max) columns_.pop_back();
    for (std::size_t i = 0; i < columns_.size(); ++i) columns_[i].push_back(result.error(i));
  }

  /// To be called once for a quantity. @pre The results were added.
  [[nodiscard]] std::vector<double> take(const Store& store, std::size_t quantity) {
    if (quantity < columns_.size()) return std::move(columns_[quantity]);
    std::vector<double> errors;
    errors.reserve(num_runs_);
    store.for_each_error(quantity, num_runs_max, [&](double error) { errors.push_back(error); });
    return errors;
  }

 private:
  std::vector<std::vector<double>> columns_;
  std::size_t num_runs_ = 0;
};

void add_total(RunIndex run, double total, std::vector<double>& totals,
               std::optional<RunTotals>& of_runs) {
  totals.push_back(total);
  if (!of_runs || total > of_runs->worst) of_runs = {.worst = total, .worst_run = run};
}

void end_totals(std::vector<double> totals, std::optional<RunTotals>& of_runs) {
  if (!of_runs) return;
  std::ranges::sort(totals);
  of_runs->median = percentile(totals, 0.5);
  of_runs->percentile_95 = percentile(totals, 0.95);
}

/// Statistics whose unit is an instrument or a replicate, of several runs each. They need all of
/// these runs: those that were given up, which have no result, count as lost.
class DependentRuns {
 public:
  DependentRuns(const Store& store, const Campaign& campaign, std::vector<RunRange> given_up)
      : given_up_(std::move(given_up)) {
    const std::uint64_t realisations = campaign.realisations;
    const SamplingDesign design = campaign.design;
    if (realisations > 1) {
      instruments_.emplace(store.schema(), campaign.objectives(), realisations);
    }
    if (design.points > 1) {
      replicates_.emplace(store.schema(), campaign.objectives(), design);
    }
    std::ranges::reverse(given_up_);
  }

  void add(const RunResult& result) {
    add_given_up_before(result.run.value);
    add_run(result);
  }

  /// @pre Every result was added, in run order.
  void finish(ReadResults& results) {
    add_given_up_before(num_runs_max);
    if (instruments_) results.instruments = instruments_->statistics();
    if (!replicates_) return;
    results.replicates = replicates_->statistics();
    for (StandardErrorStatistic& of : results.standard_errors.quantities) {
      if (of.quantity >= results.replicates->quantities.size()) continue;
      if (const auto& covered = results.replicates->quantities[of.quantity].covered) {
        of.within = covered->interval;
      }
    }
  }

 private:
  void add_given_up_before(std::uint64_t run) {
    for (; !given_up_.empty() && given_up_.back().first.value < run; given_up_.pop_back()) {
      RunResult lost;
      lost.status = RunStatus::lost;
      for (lost.run = given_up_.back().first; lost.run.value < given_up_.back().end();
           ++lost.run.value) {
        add_run(lost);
      }
    }
  }

  void add_run(const RunResult& result) {
    if (instruments_) instruments_->add(result);
    if (replicates_) replicates_->add(result);
  }

  std::optional<RunningInstruments> instruments_;
  std::optional<RunningReplicates> replicates_;
  std::vector<RunRange> given_up_;  ///< Not added yet, the next one last.
};

}  // namespace

void MissingEstimates::add(const RunResult& result) {
  if (result.status == RunStatus::not_converged) ++num_not_converged;
  if (result.status == RunStatus::not_finite) ++num_not_finite;
  if (result.status == RunStatus::no_draw) ++num_no_draw;
  if (result.status == RunStatus::lost) ++num_lost;
}

std::uint64_t MissingEstimates::total() const {
  return num_not_converged + num_not_finite + num_no_draw + num_lost + num_given_up;
}

std::string reasons_text(const MissingEstimates& missing) {
  const std::array<std::pair<std::uint64_t, std::string_view>, 5> reasons{
      {{missing.num_not_converged, "not converged"},
       {missing.num_not_finite, "not finite"},
       {missing.num_no_draw, "without draw"},
       {missing.num_lost, "lost"},
       {missing.num_given_up, "given up"}}};
  std::string text;
  for (const auto& [count, reason] : reasons) {
    if (count > 0) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", count, reason);
  }
  return text;
}

namespace {

void add_loss(const Loss& loss, std::vector<LostRuns>& losses) {
  if (loss.cause == 0) return;
  const auto same = std::ranges::find(losses, loss, &LostRuns::loss);
  if (same == losses.end()) {
    losses.push_back({loss, 1});
  } else {
    ++same->num_runs;
  }
}

void add_warnings(const Warner& warner, const RunResult& result, CampaignWarnings& all) {
  if (!warner || !result.is_completed()) return;
  const std::vector<Warning> warnings = warner(result);
  if (!warnings.empty()) ++all.num_runs;
  for (const Warning& warning : warnings) {
    const auto is_same = [&](const WarnedQuantity& other) {
      return other.effect == warning.effect && other.quantity == warning.quantity;
    };
    auto found = std::ranges::find_if(all.quantities, is_same);
    if (found == all.quantities.end()) {
      found = all.quantities.insert(found, {warning.effect, warning.quantity});
    }
    ++found->num_runs;
    if (warning.part > found->largest_part) {
      found->largest_part = warning.part;
      found->run = result.run;
    }
    if (all.first.size() < num_warnings_kept) all.first.push_back({result.run, warning});
  }
}

}  // namespace

std::string warnings_text(const ResultSchema& schema, const CampaignWarnings& warnings) {
  if (warnings.num_runs == 0) return "";
  std::string text =
      fmt::format("          {} completed with a warning; the largest shifts, in objectives:\n",
                  warnings.num_runs);
  for (const WarnedQuantity& of : warnings.quantities) {
    text += fmt::format("          {:.2g} of {}, by {} ({}, most in run {})\n", of.largest_part,
                        schema.quantities[of.quantity].symbol, of.effect,
                        counted(of.num_runs, "run"), of.run.value);
  }
  return text;
}

JudgedRuns judged_runs(std::vector<RunRange> finished, std::span<const RunRange> given_up) {
  const auto first_of = [](const RunRange& range) { return range.first.value; };
  std::vector<RunRange>& settled = finished;
  settled.insert(settled.end(), given_up.begin(), given_up.end());
  std::ranges::sort(settled, {}, first_of);
  JudgedRuns judged{.end = settled.empty() ? 0 : first_of(settled.front())};
  for (const RunRange& range : settled) {
    if (first_of(range) == judged.end) {
      judged.end = range.end();
    } else {
      judged.num_left_out += range.count;
    }
  }
  for (const RunRange& range : given_up) {
    if (first_of(range) < judged.end) judged.num_given_up += range.count;
  }
  return judged;
}

ReadResults read_results(const Store& store, const Campaign& campaign,
                         const ResultVisitor& further) {
  ReadResults results;
  const std::vector<double> objectives = campaign.objectives();
  RunningStatistics statistics(objectives);
  const bool are_independent = why_not_independent(campaign).empty();
  RunningStandardErrors standard_errors(store.schema(), are_independent);
  KeptErrors kept(objectives.size());
  std::vector<double> totals;
  const std::optional<ErrorBudget> budget = campaign.error_budget();
  const Warner warner = campaign.warner();
  store.read_one_state([&] {
    results.given_up = store.given_up_runs();
    results.missing.num_given_up = num_runs_in(results.given_up);
    DependentRuns groups(store, campaign, results.given_up);
    Digest digest(store.schema());
    store.for_each_result([&](const RunResult& result) {
      require_in_range(result, store.schema());
      statistics.add(result);
      results.missing.add(result);
      if (result.status == RunStatus::lost) add_loss(result.loss, results.losses);
      standard_errors.add(result);
      groups.add(result);
      kept.add(result);
      if (budget && result.is_completed()) {
        add_total(result.run, budget->of_run(result).total, totals, results.totals);
      }
      digest.add(result);
      add_warnings(warner, result, results.warnings);
      if (further.result) further.result(result);
    });
    end_totals(std::move(totals), results.totals);
    results.digests = digest.finish();
    results.statistics = statistics.statistics();
    results.standard_errors = standard_errors.statistics();
    for (std::size_t i = 0; i < objectives.size() && results.statistics.num_estimated > 0; ++i) {
      std::vector<double> errors = kept.take(store, i);
      complete(results.statistics.accuracy[i], errors);
      if (further.magnitudes) further.magnitudes(i, errors);
    }
    if (!are_independent) leave_out_intervals(results.statistics);
    groups.finish(results);
  });
  return results;
}

ReadResults read_checked_results(const Store& store, const Campaign& campaign,
                                 const ResultVisitor& further) {
  ReadResults results;
  store.read_one_state([&] {
    results = read_results(store, campaign, further);
    results.is_digest_checked = check_digest(store, results.statistics.num_runs, results.digests);
    check_given_up(store, results);
    const auto differences = stop_check_differences(store, campaign.objectives());
    if (!differences.empty()) store.refuse_as_damaged(differences.front());
  });
  return results;
}

void update_statistics(Store& store, const Campaign& campaign) {
  if (are_current(store)) return;
  write_statistics(store, campaign, read_results(store, campaign));
}

void write_statistics(Store& store, const Campaign& campaign, const ReadResults& results) {
  store.write_statistics(results.statistics, campaign.error_budget(), results.digests,
                         results.warnings.first);
}

Digest::Digest(const ResultSchema& schema) : num_quantities_(schema.quantities.size()) {}

void Digest::add(const RunResult& result) {
  const auto add_all = [](const std::vector<double>& values, Sha256& hash) {
    for (const double value : values) hash.add(value);
  };
  const auto add_if = [&](bool has_meaning, const std::vector<double>& values) {
    for (std::size_t i = 0; i < num_quantities_; ++i) hash_.add(has_meaning ? values[i] : 0.0);
  };
  hash_.add(result.run.value);
  hash_.add(static_cast<std::uint32_t>(result.status));
  hash_.add(result.num_draws);
  hash_.add(result.num_rounds);
  hash_.add(std::uint32_t{0});
  add_if(result.has_truth(), result.truth);
  add_if(result.has_estimate(), result.estimate);
  add_all(result.standard_error, hash_);
  add_all(result.fit, hash_);
  add_all(result.correlations, hash_);

  if (result.health.empty()) return;
  has_health_ = true;
  health_hash_.add(result.run.value);
  add_all(result.health, health_hash_);
  const Loss loss = result.status == RunStatus::lost ? result.loss : Loss{};
  health_hash_.add(loss.cause);
  health_hash_.add(loss.session);
}

ResultDigests Digest::finish() {
  ResultDigests digests{.results = hash_.finish(), .health = {}};
  if (has_health_) digests.health = health_hash_.finish();
  return digests;
}

namespace {

/// What is stored with the statistics of all these results; empty if that is of fewer results, or
/// not there yet.
std::optional<Summary> summary_of_all(const Store& store, std::uint64_t num_results) {
  std::optional<Summary> summary = store.summary();
  if (!summary) {
    // Both are written in one transaction.
    if (store.has_statistics()) store.refuse_as_damaged("its statistics are there without summary");
    return std::nullopt;
  }
  if (summary->num_finished != summary->num_counted) {
    store.refuse_as_damaged(fmt::format("summary.num_finished is {} and its kinds are {}",
                                        summary->num_finished, summary->num_counted));
  }
  if (num_results < summary->num_finished) {
    store.refuse_as_damaged(fmt::format("it has {} results, and its statistics are of {}",
                                        num_results, summary->num_finished));
  }
  if (num_results > summary->num_finished) return std::nullopt;
  return summary;
}

}  // namespace

bool check_digest(const Store& store, std::uint64_t num_results, const ResultDigests& digests) {
  const std::optional<Summary> summary = summary_of_all(store, num_results);
  if (!summary) return false;
  const auto require_same = [&](const std::string& now, const std::string& stored,
                                const char* what) {
    if (now == stored) return;
    store.refuse_as_damaged(fmt::format("the digest of {} {} results is {} and not {}, as stored",
                                        what, num_results, now.empty() ? "none" : now,
                                        stored.empty() ? "none" : stored));
  };
  require_same(digests.results, summary->digests.results, "its");
  require_same(digests.health, summary->digests.health, "the health of its");
  return true;
}

WalkedResults walk_checked(const Store& store, const std::function<void(const RunResult&)>& visit) {
  WalkedResults walked;
  store.read_one_state([&] {
    Digest digest(store.schema());
    store.for_each_result([&](const RunResult& result) {
      visit(result);
      digest.add(result);
      ++walked.num_results;
    });
    const ResultDigests digests = digest.finish();
    walked.digest = digests.results;
    walked.is_digest_checked = check_digest(store, walked.num_results, digests);
  });
  return walked;
}

void check_results_before_more(const Store& store) {
  store.read_one_state([&] {
    if (!summary_of_all(store, num_runs_in(store.finished_runs()))) return;
    (void)walk_checked(store, [](const RunResult&) {});
  });
}

void check_definition_digest(const Store& store) {
  const std::string stored = store.table_digest();
  if (stored.empty()) return;
  const std::string computed = store.computed_table_digest();
  if (computed == stored) return;
  store.refuse_as_damaged(
      fmt::format("the digest of its definition is {} and not {}, as stored", computed, stored));
}

}  // namespace proofmass::coordinator
