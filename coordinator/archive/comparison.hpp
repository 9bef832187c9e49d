#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "coordinator/archive/archive_error.hpp"
#include "coordinator/report/read_results.hpp"
#include "coordinator/table/table.hpp"
#include "core/campaign/campaign.hpp"
#include "core/campaign/run_result.hpp"
#include "core/statistics/error_change.hpp"
#include "core/statistics/interval.hpp"

namespace proofmass::coordinator {

/// Results in run order, one a call; empty after the last.
using ResultStream = std::function<std::optional<RunResult>()>;

/// estimate − truth of one parameter over all runs of one side with an estimate, SI.
struct ComparedAccuracy {
  double bias = 0.0;                ///< Mean of estimate − truth.
  double standard_deviation = 0.0;  ///< Of estimate − truth, with n − 1; 0 for a single run.
  double mean = 0.0;                ///< Of |estimate − truth|.
  double worst = 0.0;               ///< Largest |estimate − truth|.
  std::size_t num_in_tail = 0;  ///< Runs with |estimate − truth| > ParameterComparison::tail_limit.
};

struct ParameterComparison {
  Quantity quantity;  ///< As the first campaign has it.
  ComparedAccuracy first;
  ComparedAccuracy second;
  double bias_change = 0.0;  ///< Second bias − first: of the pairs, if there are any.
  std::optional<Interval> bias_interval;  ///< Of bias_change; empty if nothing varies.
  double tail_limit = 0.0;                ///< tail_limit() of both campaigns, SI.
  /// See smallest_scale_factor(); empty below num_welch_min runs unless runs are paired.
  std::optional<double> smallest_scale_factor;
  ChangePValues p_values;  ///< That chance alone makes such a change.
  /// That chance alone makes one in any test of all parameters; see adjust_together().
  ChangePValues adjusted_p_values;
};

/// Runs of one of two campaigns.
struct ComparedRuns {
  std::size_t num_estimated = 0;
  std::size_t num_alone = 0;   ///< Of them, not computed in the other campaign; 0 unless paired.
  std::size_t num_tested = 0;  ///< Of these, tested beside the pairs.
};

/// What two campaigns differ in, and what that does to the accuracy.
struct CampaignComparison {
  /// Of the definitions, then `model` and `build`.
  std::vector<DefinitionDifference> differences;
  /// Why the draws are not the same, run by run; empty if they are, and pairs are compared.
  std::string why_unpaired;
  ComparedRuns first;
  ComparedRuns second;
  std::size_t num_pairs = 0;  ///< Runs with an estimate in both; 0 unless paired.
  /// Why the parameters are not compared; empty if they are.
  std::string why_not_compared;
  /// Of each quantity that both campaigns have, in the order of the first.
  std::vector<ParameterComparison> parameters;

  [[nodiscard]] bool is_paired() const { return why_unpaired.empty(); }
};

/// Most campaigns that `compare` takes: each is compared with the first, and has a row for each
/// parameter.
inline constexpr std::size_t num_compared_max = 64;

/// One of several campaigns, and how it differs from the first.
struct ComparedCampaign {
  std::filesystem::path file = {};
  std::shared_ptr<const Campaign> campaign;
  std::vector<Quantity> quantities = {};  ///< Of its results.
  std::string model_version = {};
  std::uint64_t reference_digest = 0;  ///< Store::reference_digest().
  std::string build = {};
  std::uint64_t num_left_out = 0;  ///< JudgedRuns::num_left_out: in no comparison.
  ReadResults results = {};        ///< Of all runs.
  /// Begins with the first result, the same ones each time; nothing once its file is closed.
  std::function<ResultStream()> open_results = {};
  /// With the first campaign as its first side; empty for the first campaign itself. The adjusted
  /// p-values are those of adjust_together().
  std::optional<CampaignComparison> comparison = {};
};

/// Compares the quantities that both campaigns have, in the runs with an estimate: run by run, if
/// their seed and the truths of these quantities in all common runs agree to the last bit, and else
/// all of each. P-values are of compare_paired_errors() for pairs, else of compare_errors();
/// intervals are of 95 %.
///
/// Runs that only one campaign has computed are held against all runs of the other by
/// compare_errors() if they are as many as the pairs. They share no draw with these, so that twice
/// the smaller p-value holds for both tests together.
///
/// Keeps the errors of as many parameters at a time as some 128 MB hold, of one at least: up to
/// 800,000 runs in both together each file is read once.
[[nodiscard]] CampaignComparison compare_campaigns(const ComparedCampaign& first,
                                                   const ComparedCampaign& second);

/// Reads campaigns and compares each with the first, as compare_campaigns().
/// @param files  At least two.
/// @throws StoreError or DefinitionError if a file cannot be read or holds other results than were
///         stored, see check_digest(); Interrupted.
[[nodiscard]] std::vector<ComparedCampaign> compare_several(
    std::span<const std::filesystem::path> files, const HeedStop& heed_stop);

/// Corrects the p-values of all parameters and all campaigns together, see adjusted_changes(): the
/// more campaigns are compared, the larger a change must be to be significant. What was not
/// compared is left out.
void adjust_together(std::span<ComparedCampaign> members);

/// What several campaigns are called in their tables.
struct MemberNames {
  std::string title;               ///< `campaign`, or the key that was varied.
  std::vector<std::string> names;  ///< Of each: `A`, or the value of the key.
};

/// `A` to `Z`, `AA`, `AB` and so on.
[[nodiscard]] MemberNames lettered(std::size_t count);

/// Where the quantity is among those of another campaign, by name and unit; their number if it is
/// not there: numbers of two units have nothing to do with one another.
[[nodiscard]] std::size_t place_of(const Quantity& quantity, std::span<const Quantity> among);

/// The quantities of the first list that the second lacks.
[[nodiscard]] std::vector<Quantity> lacking(std::span<const Quantity> first,
                                            std::span<const Quantity> second);

/// The campaigns, the keys of their definitions that differ, and tables of bias, scatter and
/// |error| with a row for each parameter and each campaign that has it. Lines have at most 80
/// characters but for names of files and values of definitions that are longer.
[[nodiscard]] std::string comparison_text(std::span<const ComparedCampaign> members,
                                          const MemberNames& names, Paint paint = Paint::no);

/// A text of a key, for JSON.
using KeyText = std::pair<std::string, std::string>;

/// A comparison as JSON, complete and in SI units: of two campaigns one object, of several a list
/// of campaigns, each with its comparison with the first.
/// @param varied  Keys with their values for each campaign, which is in the list then, even of two;
///                empty if none was varied.
[[nodiscard]] nlohmann::ordered_json comparison_json(
    std::span<const ComparedCampaign> members, std::span<const std::vector<KeyText>> varied = {});

}  // namespace proofmass::coordinator
