#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "coordinator/report/read_results.hpp"
#include "coordinator/report/requirements.hpp"
#include "coordinator/report/sensitivity.hpp"
#include "coordinator/report/standard_errors.hpp"
#include "coordinator/store/records.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/campaign.hpp"
#include "core/runs.hpp"
#include "core/statistics/interval.hpp"
#include "core/statistics/moments.hpp"

namespace proofmass::coordinator {

/// What the first n runs that have an estimate tell of |error|, SI.
struct ConvergencePoint {
  std::uint64_t num_runs = 0;
  double worst = 0.0;
  double mean = 0.0;
  std::optional<Interval> mean_interval = {};  ///< 95 %; empty for one run.
  double standard_deviation = 0.0;
  /// 95 %, by the kurtosis of the errors; empty below five runs. The bootstrap of the tables would
  /// need all errors at each point.
  std::optional<Interval> deviation_interval = {};
};

/// What the charts of one quantity show: binned or thinned, whatever the number of runs.
struct QuantityFigures {
  Histogram magnitudes;         ///< Of |error|, SI.
  Histogram errors;             ///< Of the error with its sign, SI.
  std::vector<RunValue> worst;  ///< The five largest |error|; of equal ones the first.
  std::vector<ConvergencePoint> convergence;  ///< At most 42, the last of all runs.
};

/// Adds a value to the largest ones, in descending order, if it is one of these; of equal ones the
/// first stays.
/// @param count  Of those that are kept; at least 1.
void keep_largest(const RunValue& candidate, std::size_t count, std::vector<RunValue>& largest);

/// The numbers of runs at which convergence is shown: 40 from 5 on, of at most 5 runs from 1 on,
/// equally spaced on a logarithmic axis. Ascending, without repetition.
/// @param num_runs  The last one, unless it is 0.
[[nodiscard]] std::vector<std::uint64_t> convergence_counts(std::uint64_t num_runs);

/// Computes them from results that are seen once, in run order. Memory is some 100 kB.
class ErrorFigures {
 public:
  /// @param num_runs               Finished runs, with an estimate or without.
  /// @param are_draws_independent  Else there are no intervals.
  ErrorFigures(std::size_t num_quantities, std::uint64_t num_runs,
               bool are_draws_independent = true);

  void add(const RunResult& result);

  /// Of each quantity. To be called once, after all results.
  [[nodiscard]] std::vector<QuantityFigures> figures();

 private:
  struct Growing {
    MagnitudeBins magnitudes;
    ErrorBins errors;
    std::optional<MomentSums> sums;  ///< About the first |error|, which is of their size.
    QuantityFigures figures = {};    ///< Without the histograms, which are made at the end.
  };

  static void add_error(RunIndex run, double error, Growing& quantity);
  void add_convergence();

  bool are_draws_independent_;
  std::uint64_t num_estimated_ = 0;
  std::vector<std::uint64_t> counts_;
  std::size_t next_count_ = 0;
  std::vector<Growing> quantities_;
};

/// Amplitude spectral densities, one-sided, in the signal's unit per √Hz: roots of the mean PSD of
/// neighbouring bins.
struct SpectrumPoint {
  double frequency_hz = 0.0;
  double measured = 0.0;
  double residual = 0.0;  ///< Of what is left when the fitted lines are subtracted.
  double expected = 0.0;  ///< Of the noise model; 0 if there is no noise.
};

/// A line as the session's estimation fits it.
struct SpectrumLine {
  double frequency_hz = 0.0;
  double amplitude = 0.0;  ///< Of the signal before any filter, in its unit.
  double height = 0.0;     ///< That a sine of this amplitude has in the spectrum, unit/√Hz.
  bool is_used = false;    ///< By the estimate; the others are fitted beside those.
};

/// A ratio of noise powers, with a bound of its standard error.
struct NoiseRatio {
  double value = 0.0;
  double standard_error = 0.0;
};

/// The spectrum of a signal in a session of a run.
struct SessionSpectrum {
  std::string session;
  std::string meaning;  ///< Of the signal, a phrase for people.
  std::string unit;
  std::vector<SpectrumPoint> points;  ///< In the order of frequencies.
  std::vector<SpectrumLine> lines;    ///< Those that the estimate uses come first.
  /// Power of what is left of the signal over that of the noise model, from the median of all bins
  /// up to a factor of three away from the lines that the estimate uses, without those of fitted
  /// lines. Empty if there is no noise, or no such bin.
  std::optional<NoiseRatio> noise_ratio;
  std::string noise_meaning;  ///< A sentence for people.
};

/// The spectra of a replayed run.
struct RunSpectra {
  RunIndex run;
  std::vector<SessionSpectrum> sessions;
  std::vector<std::string> reasons;  ///< Sentences: why there are none, or not all.
};

/// Everything that reports and their charts are made of.
struct Review {
  std::string database = {};  ///< As commands name it; whoever read the review knows that.
  /// Options of `report` that make this one anew, as a shell reads them, each after a blank.
  std::string options = {};
  // What the database says of itself. Any of these texts may come from a stranger.
  std::string name = {};
  std::uint64_t seed = 0;
  std::uint64_t num_runs = 0;                        ///< Wanted.
  std::optional<std::uint64_t> num_runs_fixed = {};  ///< Store::num_runs_fixed().
  std::string model_version = {};
  bool is_of_program = false;  ///< Its model needs one to be simulated again.
  bool is_imported = false;    ///< Model::is_imported().
  std::string note = {};       ///< Campaign::note(), and of contradictions.
  std::string build = {};
  std::string created_utc = {};
  std::string definition_digest = {};
  ResultSchema schema = {};  ///< What the results are.
  ReadResults results = {};
  std::vector<double> objectives = {};  ///< Of each quantity, SI.
  Interpretation interpretation = Interpretation::mixed;
  std::optional<ErrorBudget> budget = {};
  std::vector<QuantityFigures> figures = {};  ///< Of each quantity.
  /// In the order in which requirements are stated.
  std::vector<RequirementAnswer> matrix = {};
  /// See why_not_independent(); then the matrix has no verdicts to be shown.
  std::string why_not_independent = {};
  std::optional<Causes> causes = {};       ///< Empty if runs are too few, or not asked for.
  std::optional<RunSpectra> spectra = {};  ///< Of worst_run_of(); empty if not asked for.
  CampaignExecution execution = {};
  std::uint64_t num_contradicting = 0;  ///< Store::num_contradicting().
  bool is_cancelled = false;
  std::optional<StopOutcome> stop = {};
};

/// The run with the largest |error| of any quantity beside its objective; none if no run has an
/// estimate or no quantity has an objective.
[[nodiscard]] std::optional<RunIndex> worst_run_of(const Review& review);

/// What the matrix of a review says of a requirement that it was read with.
[[nodiscard]] const RequirementAnswer& answer_to(const StatedRequirement& stated,
                                                 const Review& review);

/// What a review has beside the results, each with what comes before it.
enum class ReviewDepth : std::uint8_t {
  matrix,
  charts,  ///< Also how the campaign was executed.
  causes,
};

/// Why a run computed a second time has another result, for people: `a worker computes wrongly`.
[[nodiscard]] std::string_view cause_of_contradictions(const Model& model);

/// Reads all results, of one state of the file, as read_checked_results() does, and once more for
/// the causes.
///
/// @param stated  Requirements; of none, the objectives. All objectives together follow, unless
///                they are asked for or the campaign has none.
/// @throws ConfigError as parse_requirement(); StoreError as read_checked_results().
[[nodiscard]] Review read_review(const Store& store, const Campaign& campaign, ReviewDepth depth,
                                 std::vector<StatedRequirement> stated = {});

}  // namespace proofmass::coordinator
