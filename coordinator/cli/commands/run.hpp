#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "coordinator/archive/comparison.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "core/campaign/campaign.hpp"
#include "core/runs.hpp"

namespace proofmass::coordinator {

struct RunOptions {
  std::filesystem::path campaign_file;
  std::optional<std::filesystem::path> database;  ///< By default STEM.db in the current directory.
  Overrides overrides;
  std::optional<unsigned> num_workers;   ///< By default one for each processor.
  std::string gpus = "none";             ///< Cards of this machine, as for a worker.
  std::optional<double> audit_fraction;  ///< Of the runs that are missing, computed twice; 0 to 1.
  std::optional<RunRange> part;          ///< Only these runs are computed.
  StopPlan stop;                         ///< Without StopPlan::num_runs_max.
  PageConfig page;
  bool is_quiet = false;
  /// Of the tables; empty: they are not printed.
  std::optional<OutputFormat> output = OutputFormat::text;
};

/// Declares the options of `run` that say which campaign is run and how, but for FILE, --db,
/// --range and those of the page.
void add_run_options(CLI::App& command, RunOptions& options);

/// What a database may be asked for by `run` and its options.
[[nodiscard]] StopPlan stop_plan_of(const RunOptions& options, std::uint64_t num_runs);

/// Runs what is missing of a campaign with local workers and prints its tables. A run that crashes
/// its workers is given up, and tried again the next time.
/// @return An ExitCode; exit_not_met if all runs together do not reach the stop rule, or if
///         audits contradict them.
/// @throws Error if the campaign file, the database or the workers cannot be used.
[[nodiscard]] int run_campaign(const RunOptions& options);

inline constexpr std::size_t num_swept_max = 1000;

/// A key of a campaign file and the values that it gets, one after the other.
struct VariedKey {
  std::string key;                  ///< `noise.scale`.
  std::vector<std::string> values;  ///< As in a campaign file: `0.5`, `"first_order"`, `[1, 2]`.
};

/// Reads `noise.scale=0.5,1,2`. A comma within brackets, braces or quotes separates no values.
/// @throws UsageError `vary = noise.scale=1,1 (has the value 1 twice)`, or if there is no key, no
///         value or an empty one.
[[nodiscard]] VariedKey parse_varied(std::string_view text);

/// The values of all varied keys in one campaign of a sweep, in the order of the keys.
using SweptValues = std::vector<KeyText>;

/// Every combination of the values; the last key varies fastest.
/// @throws UsageError if a key is named twice, if there are fewer than two combinations, or more
///         than num_swept_max.
[[nodiscard]] std::vector<SweptValues> combinations(std::span<const VariedKey> keys);

/// `noise.scale=0.5,environment.drag=0`.
[[nodiscard]] std::string text_of(const SweptValues& values);

/// File name of a campaign of a sweep: `mine-noise.scale=0.5.db`. The same values always have the
/// same name, without quotes. If another character is no letter or digit and none of `.,=+-_`, or
/// if the name would have more than 200 bytes, it ends in a part of a digest of the values.
/// @param stem  Of the campaign file.
[[nodiscard]] std::string sweep_file_name(std::string_view stem, const SweptValues& values);

/// Names the campaigns of a sweep in tables by their values, if these are short, else by letters.
[[nodiscard]] MemberNames sweep_names(std::span<const SweptValues> campaigns);

/// The campaign's first batch, which is a full one unless the campaign has fewer runs.
struct FirstBatch {
  /// Processor time on this machine, extrapolated from the steps that the first half second takes.
  /// All steps of a run take about the same time. Of a model program, the time that passes, with
  /// the first run for all others if it takes as long.
  double time_s = 0.0;
  std::vector<RunResult> results;  ///< Empty if half a second was not enough for all steps.
};

[[nodiscard]] FirstBatch try_first_batch(const Campaign& campaign, const Plan& plan);

/// What it costs to run campaigns on this machine.
struct CostEstimate {
  double one_core_s = 0.0;   ///< On one core.
  double all_cores_s = 0.0;  ///< On all of them, with `proofmass run`.
  double disk_mb = 0.0;      ///< Of the databases.

  CostEstimate& operator+=(const CostEstimate& other);
};

/// Of a campaign with so many runs, whose batches take so long. `run` gives each core one batch of
/// runs at a time. The last batch counts as a whole one, which it costs at most.
[[nodiscard]] CostEstimate estimated_cost(const Campaign& campaign, std::uint64_t num_runs,
                                          double batch_s);

/// Two lines that begin with `Time      about` and `Disk      about`.
[[nodiscard]] std::string cost_text(const CostEstimate& cost);

}  // namespace proofmass::coordinator
