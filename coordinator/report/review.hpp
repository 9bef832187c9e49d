#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "coordinator/report/error_figures.hpp"
#include "coordinator/report/read_results.hpp"
#include "coordinator/report/requirements.hpp"
#include "coordinator/report/sensitivity.hpp"
#include "coordinator/report/summarise.hpp"
#include "coordinator/store/records.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/campaign.hpp"
#include "core/runs.hpp"

namespace proofmass::coordinator {

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
  std::uint64_t num_runs = 0;  ///< Wanted.
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
  tables,
  matrix,
  charts,  ///< Also how the campaign was executed.
  causes,
};

/// Reads all results, of one state of the file, as read_checked_results() does, and once more for
/// the causes.
///
/// @param stated  Requirements; of none, the objectives. All objectives together follow, unless
///                they are asked for or the campaign has none.
/// @throws ConfigError as parse_requirement(); StoreError as read_checked_results().
[[nodiscard]] Review read_review(const Store& store, const Campaign& campaign, ReviewDepth depth,
                                 std::vector<StatedRequirement> stated = {});

}  // namespace proofmass::coordinator
