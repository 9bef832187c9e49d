#include "coordinator/archive/verification.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <iterator>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "coordinator/archive/export.hpp"
#include "coordinator/archive/replay.hpp"
#include "coordinator/archive/stored_campaign.hpp"
#include "coordinator/report/read_results.hpp"
#include "coordinator/report/review.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/result_columns.hpp"
#include "core/model.hpp"
#include "core/runs.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

constexpr std::string_view unfit = "not what follows from definition and results";

/// What one pass over all results of a campaign database finds. Runs are ranges: memory does not
/// grow with them unless every other one is missing.
struct ResultScan {
  std::vector<RunRange> runs;  ///< Finished ones, ascending.
  ResultDigests digests;       ///< Of their results.
  std::uint64_t num_violations = 0;
  std::vector<std::string>
      violations;  ///< details_named_max at most: `run 3: num_draws = 0 (rule)`.

  void violate(RunIndex run, const std::string& what) {
    if (num_violations++ >= details_named_max) return;
    violations.push_back(fmt::format("run {}: {}", run.value, what));
  }

  /// Reports each of these runs that is not one of those; both ascending.
  void violate_missing(std::span<const RunRange> those, std::span<const RunRange> these,
                       const std::string& what) {
    std::vector<RunIndex> missing;
    std::ranges::set_difference(indices_of(these), indices_of(those), std::back_inserter(missing));
    for (const RunIndex run : missing) violate(run, what);
  }
};

/// The checks of one file, each made once, in order.
class Verification {
 public:
  Verification(const std::filesystem::path& file, const VerifyOptions& options,
               const std::function<void(const Check&)>& report, const HeedStop& heed_stop)
      : file_(file), options_(options), report_(report), heed_stop_(heed_stop) {}

  void run() {
    make("file", [this] { return check_file(); });
    make("integrity", [this] { return check_integrity(); });
    make("definition", [this] { return check_definition(); });
    make("model", [this] { return check_model(); });
    if (store_) {
      // A coordinator may end the campaign meanwhile, with statistics of results not read here.
      store_->read_one_state([this] { run_result_checks(); });
    } else {
      run_result_checks();
    }
    make("simulation", [this] { return check_simulation(); });
  }

 private:
  void run_result_checks() {
    make("results", [this] { return check_results(); });
    make_of_results("digest", [this] { return check_digest(); });
    make_of_results("statistics", [this] { return check_statistics(); });
    make_of_results("stop_checks", [this] { return check_stop_checks(); });
    make("audit", [this] { return check_contradictions(); });
    make("draws", [this] { return check_draws(); });
  }

  template <typename Make>
  void make(std::string_view name, const Make& make_check) {
    heed_stop_();
    Check check;
    try {
      check =
          store_ || name == "file" ? make_check() : Check::not_checked("the file cannot be opened");
    } catch (const Interrupted&) {
      throw;
    } catch (const Error& error) {
      check = Check::fails(error.what());
    }
    check.name = name;
    report_(check);
  }

  template <typename Make>
  void make_of_results(std::string_view name, const Make& make_check) {
    make(name,
         [&] { return scan_ ? make_check() : Check::not_checked("the results cannot be read"); });
  }

  Check check_file() {
    store_ = Store::open_read_only(file_);
    return Check::holds(fmt::format("{}, made {}", store_->name(), store_->created_utc()));
  }

  Check check_integrity() {
    store_->check_integrity();
    return Check::holds("every page, row, index and reference; the schema");
  }

  Check check_definition() {
    campaign_ = store_->campaign();
    std::vector<std::string> details = store_->parameter_differences(*campaign_);
    const std::string stored = store_->table_digest();
    const std::string computed = store_->computed_table_digest();
    if (computed != stored) {
      details.push_back(
          fmt::format("campaign.table_digest = {} (must be {}, that of definition and tables)",
                      stored, computed));
    }
    if (details.empty()) {
      return Check::holds(
          fmt::format("valid: seed {}, {} runs", campaign_->seed, campaign_->num_runs));
    }
    return Check::fails("the file is not of the campaign that it defines", std::move(details));
  }

  Check check_model() {
    const std::string model = store_->model_version();
    why_no_runs_ = store_->model().why_no_runs();
    const std::string_view own =
        options_.model_version.empty() ? store_->model().version() : options_.model_version;
    is_same_model_ = model == own || !why_no_runs_.empty();
    if (!why_no_runs_.empty()) return Check::not_checked(model);  // Why, the simulation says.
    if (is_same_model_) return Check::holds(fmt::format("{}; {}", model, store_->build()));
    return Check::not_checked(
        fmt::format("{} made this file and this program has {}: its runs cannot be "
                    "simulated again",
                    model, own));
  }

  Check check_results() {
    if (!campaign_) return Check::not_checked("the definition cannot be read");
    scan_ = scan_results();
    const std::string counts =
        fmt::format("{} of {} runs", num_runs_in(scan_->runs), store_->num_runs());
    if (scan_->num_violations == 0) return Check::holds(counts + ": each number obeys its rule");
    return Check::fails(fmt::format("{}: {} {} broken", counts, scan_->num_violations,
                                    scan_->num_violations == 1 ? "rule is" : "rules are"),
                        scan_->violations, scan_->num_violations - scan_->violations.size());
  }

  /// Reads all results and holds them against the rules of their status, and against the list of
  /// those who delivered them.
  [[nodiscard]] ResultScan scan_results() const {
    ResultScan scan;
    const ResultSchema& schema = store_->schema();
    const std::vector<ValueColumn> columns = value_columns(schema);
    const std::int64_t num_rounds_max = campaign_->num_rounds_max();
    Digest digest(schema);
    store_->for_each_result(stoppable(heed_stop_, [&](const RunResult& result) {
      for (const std::string& broken :
           broken_count_rules(result, schema.num_draws_max, num_rounds_max)) {
        scan.violate(result.run, broken);
      }
      for (const ValueColumn& column : columns) {
        if (column.kind == ValueKind::error) continue;  // Follow from the others.
        const std::optional<double> value = column.value_in(result);
        if (!value || is_in_range(*value)) continue;
        scan.violate(result.run, fmt::format("{} = {} (must be in [{}, {}])", column.name, *value,
                                             -magnitude_max, magnitude_max));
      }
      digest.add(result);
      append(scan.runs, result.run);
    }));
    scan.digests = digest.finish();
    const std::vector<RunRange> delivered = store_->finished_runs();
    if (delivered == scan.runs) return scan;
    scan.violate_missing(scan.runs, delivered, "has a delivery and no result");
    scan.violate_missing(delivered, scan.runs, "has a result and no delivery");
    return scan;
  }

  // A coordinator stores the digest when it ends; until then there are newer results.
  Check check_digest() {
    const std::optional<Summary> summary = store_->summary();
    if (!summary) {
      return Check::not_checked("none is stored: a coordinator has the file, or was killed");
    }
    const std::uint64_t num_now = num_runs_in(scan_->runs);
    if (num_now > summary->num_finished) {
      return Check::not_checked(
          fmt::format("it is of {} runs and {} are finished: a coordinator has the "
                      "file, or was killed",
                      summary->num_finished, num_now));
    }
    if (num_now < summary->num_finished) {
      return Check::fails(fmt::format("it is of {} runs, of which {} are in the file",
                                      summary->num_finished, num_now));
    }
    const ResultDigests& stored = summary->digests;
    const ResultDigests& computed = scan_->digests;
    if (stored == computed) {
      Check check = Check::holds(fmt::format("of {} runs", num_now));
      check.details = {computed.results};
      return check;
    }
    const bool is_of_health = stored.results == computed.results;
    Check check = Check::fails(fmt::format(
        "the {} of {} runs {} not {} it was made of", is_of_health ? "health" : "results", num_now,
        is_of_health ? "is" : "are", is_of_health ? "that" : "those"));
    check.details = {"stored", "  " + (is_of_health ? stored.health : stored.results), "computed",
                     "  " + (is_of_health ? computed.health : computed.results)};
    return check;
  }

  /// Holds `statistic`, `budget_entry`, `run_warning` and `summary` against the results that the
  /// summary is of. A coordinator brings them up to date when a campaign ends or is stopped: in
  /// between they are of fewer results, and only what does not depend on results is checked.
  [[nodiscard]] Check check_statistics() const {
    const std::optional<Summary> summary = store_->summary();
    const bool is_current = summary && summary->num_finished == num_runs_in(scan_->runs) &&
                            summary->digests == scan_->digests && scan_->num_violations == 0;
    if (summary && !is_current) {
      if (summary->num_counted != summary->num_finished) {
        return Check::fails(
            std::string(unfit),
            {fmt::format("summary.num_finished = {} (must be {}, the sum of its kinds)",
                         summary->num_finished, summary->num_counted)});
      }
      return Check::not_checked("they are not of the results that are in the file");
    }
    // Without a summary nothing was ever stored but the budget before estimation.
    const ReadResults results = summary ? read_results(*store_, *campaign_) : ReadResults();
    std::vector<std::string> lines = store_->statistic_differences(
        results.statistics, campaign_->error_budget(), results.warnings.first, summary);
    // A run is given up after the summary without another result, and remains so until it has one:
    // of as many results it cannot have been more.
    if (summary && summary->num_given_up > results.missing.num_given_up) {
      lines.push_back(fmt::format("summary.num_given_up = {} (must be at most {})",
                                  summary->num_given_up, results.missing.num_given_up));
    }
    if (!lines.empty()) return Check::fails(std::string(unfit), std::move(lines));
    if (!summary) {
      return Check::not_checked("none are stored: a coordinator has the file, or was killed");
    }
    const bool has_same_rules = store_->model_version() == store_->model().version();
    return Check::holds(fmt::format(
        "of {} runs: every number{}", results.statistics.num_runs,
        has_same_rules ? " and every budget" : "; budgets and warnings are another model's"));
  }

  [[nodiscard]] Check check_stop_checks() const {
    if (scan_->num_violations > 0) return Check::not_checked("a result breaks its rule");
    std::vector<std::string> lines = stop_check_differences(*store_, campaign_->objectives());
    if (!lines.empty()) return Check::fails(std::string(unfit), std::move(lines));
    const auto num_checks = static_cast<std::uint64_t>(store_->stop_checks().size());
    return Check::holds(num_checks == 0 ? "none" : fmt::format("{} of a stop rule", num_checks));
  }

  /// Fails if two workers delivered different results of one run.
  [[nodiscard]] Check check_contradictions() const {
    const std::uint64_t num_compared = store_->num_compared();
    const std::vector<Contradiction> contradictions = store_->contradictions();
    if (contradictions.empty()) {
      return Check::holds(num_compared == 0
                              ? "no run was computed twice"
                              : fmt::format("{} second {}: each is the stored one", num_compared,
                                            num_compared == 1 ? "result" : "results"));
    }
    std::vector<std::string> lines;
    for (const Contradiction& found : contradictions) {
      lines.push_back(fmt::format("run {}: {} delivered {} (must be {}, as stored)",
                                  found.run.value, found.worker, found.second_digest,
                                  found.stored_digest));
    }
    return Check::fails(
        fmt::format("{} of {} second results {} not the stored one: {}", contradictions.size(),
                    num_compared, contradictions.size() == 1 ? "is" : "are",
                    cause_of_contradictions(store_->model())),
        std::move(lines));
  }

  Check check_draws() {
    if (!is_same_model_) return Check::not_checked("another model made the file");
    if (!scan_) return Check::not_checked("the results cannot be read");
    const Redraw redraw = redraw_runs(*store_, *campaign_, options_.num_threads, heed_stop_);
    if (scan_->runs.empty()) return Check::not_checked("no run is finished");
    if (redraw.num_drawn == 0) return Check::holds("no run has one");
    if (redraw.num_different == 0) {
      return Check::holds(
          fmt::format("of {} runs made again: every truth is the same", redraw.num_drawn));
    }
    return Check::fails(
        fmt::format("of {} runs made again, of which {} {}", redraw.num_drawn, redraw.num_different,
                    redraw.num_different == 1 ? "differs" : "differ"),
        redraw.differences, redraw.num_different - redraw.differences.size());
  }

  Check check_simulation() {
    if (!is_same_model_) return Check::not_checked("another model made the file");
    if (!why_no_runs_.empty()) return Check::not_checked(why_no_runs_);
    if (!scan_) return Check::not_checked("the results cannot be read");
    const std::vector<RunIndex> chosen = chosen_runs(scan_->runs, options_.fraction);
    if (chosen.empty()) return Check::not_checked("no run is finished");
    // So many at a time that all threads are busy. Between them nothing is read: a coordinator that
    // writes meanwhile can shorten its log.
    constexpr std::size_t num_at_a_time = 4096;
    std::vector<ResultDifference> differences;
    for (std::size_t done = 0; done < chosen.size(); done += num_at_a_time) {
      const auto some =
          std::span(chosen).subspan(done, std::min(chosen.size() - done, num_at_a_time));
      std::ranges::move(
          simulate_again(*campaign_, results_of(some), options_.num_threads, heed_stop_),
          std::back_inserter(differences));
    }
    const std::string runs = fmt::format("{} of {} runs", chosen.size(), num_runs_in(scan_->runs));
    if (differences.empty()) return Check::holds(runs + " simulated again: every bit is the same");
    return simulation_failure(runs, differences);
  }

  static Check simulation_failure(const std::string& runs,
                                  const std::vector<ResultDifference>& differences) {
    std::uint64_t num_runs = 0;
    for (std::size_t i = 0; i < differences.size(); ++i) {
      if (i == 0 || differences[i].run != differences[i - 1].run) ++num_runs;
    }
    Check check = Check::fails(fmt::format("{} simulated again, of which {} {}", runs, num_runs,
                                           num_runs == 1 ? "differs" : "differ"));
    for (const ResultDifference& difference : differences) {
      if (&difference - differences.data() == details_named_max) {
        check.details.push_back(fmt::format("and {} more", differences.size() - details_named_max));
        break;
      }
      check.details.push_back(fmt::format("run {}: {}", difference.run.value, difference.column));
      check.details.push_back("  stored    " + difference.stored);
      check.details.push_back("  computed  " + difference.computed);
    }
    return check;
  }

  [[nodiscard]] std::vector<RunResult> results_of(std::span<const RunIndex> runs) const {
    std::vector<RunResult> results;
    for (const RunIndex run : runs) {
      heed_stop_();
      const std::optional<RunResult> result = store_->results({run, 1}).next();
      if (!result) {
        store_->refuse_as_damaged(fmt::format("the result of run {} went away", run.value));
      }
      results.push_back(*result);
    }
    return results;
  }

  const std::filesystem::path& file_;
  const VerifyOptions& options_;
  const std::function<void(const Check&)>& report_;
  const HeedStop& heed_stop_;

  std::optional<Store> store_;
  std::shared_ptr<const Campaign> campaign_;
  bool is_same_model_ = false;
  std::string why_no_runs_;  ///< Of the file's model.
  std::optional<ResultScan> scan_;
};

constexpr std::size_t name_width = 12;
constexpr std::size_t verdict_width = 13;

}  // namespace

void verify(const std::filesystem::path& file, const VerifyOptions& options,
            const std::function<void(const Check&)>& report, const HeedStop& heed_stop) {
  require_campaign_file(file);
  Verification(file, options, report, heed_stop).run();
}

Check Check::fails(std::string finding, std::vector<std::string> details,
                   std::uint64_t num_further) {
  if (details.size() > details_named_max) {
    num_further += details.size() - details_named_max;
    details.resize(details_named_max);
  }
  if (num_further > 0) details.push_back(fmt::format("and {} more", num_further));
  return {
      .verdict = CheckOutcome::fails, .finding = std::move(finding), .details = std::move(details)};
}

std::string_view word_for(CheckOutcome verdict) {
  constexpr std::array<std::string_view, 3> words{"ok", "FAILS", "not checked"};
  return words[static_cast<std::size_t>(verdict)];
}

std::string check_text(const Check& check, Paint paint) {
  constexpr std::array tones{Tone::good, Tone::bad, Tone::plain};
  const std::string_view word = word_for(check.verdict);
  std::string text = left_aligned(check.name, name_width) +
                     in_tone(word, tones[static_cast<std::size_t>(check.verdict)], paint) +
                     std::string(verdict_width - word.size(), ' ') +
                     wrapped(wire::visible_text(check.finding), name_width + verdict_width,
                             name_width + verdict_width) +
                     "\n";
  for (const std::string& detail : check.details) {
    text += "  " + wire::visible_text(detail) + "\n";  // It may quote the file.
  }
  return text;
}

}  // namespace proofmass::coordinator
