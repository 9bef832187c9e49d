#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/campaign/run_result.hpp"
#include "core/math/instruction_set.hpp"
#include "core/microscope/campaign/microscope_campaign.hpp"

namespace proofmass::test {

/// What noise alone costs, on one core.
struct NoiseCost {
  double deviate_ns = 0.0;  ///< One normal deviate.
  double step_ns = 0.0;     ///< All noise of one step of one run.
};

/// What the same work took on the clock, and of a processor.
struct SpentTime {
  double wall_s = 0.0;
  double processor_s = 0.0;
};

/// What a run costs with one instruction set, on one core.
struct SetCost {
  InstructionSet set = InstructionSet::scalar;
  /// Processor time in batches, a run's share of its batch; > 0.
  double run_s = 0.0;
  /// Processor time of a batch of one run, for which a set may have a kernel of its own.
  double single_s = 0.0;
  NoiseCost noise;
  bool has_reference_bits = true;  ///< Its results are those of the sets before.
};

/// What passes in a worker and a coordinator before the first sample of a campaign.
struct StartCost {
  double digest_s = 0.0;   ///< Of the reference digest, by the fastest set.
  double prepare_s = 0.0;  ///< Of what the runs of a campaign share.
};

/// A campaign on all processors, from the start of the program to its tables.
struct CampaignCost {
  std::uint64_t num_runs = 0;
  double wall_s = 0.0;
  double compute_s = 0.0;  ///< Of all runs, as the database has it.
};

/// What the parts of a step of one scalar run cost, each measured alone: their sum is not `whole`.
struct StepCost {
  double noise_ns = 0.0;
  double shared_signals_ns = 0.0;  ///< What all runs see alike: orbit, environment, excitation.
  double dynamics_ns = 0.0;
  double estimation_ns = 0.0;  ///< Ground signals, weights and sums.
  double whole_ns = 0.0;       ///< Of a step inside a run.
};

/// Where the figures were measured.
struct Machine {
  std::string processor;
  unsigned num_processors = 1;
  std::string compiler;
  std::string build_type;
};

/// What `proofmass_bench` shows.
struct BenchFigures {
  Machine machine;
  std::uint64_t num_runs = 0;   ///< Runs of each set but `scalar`, which computes one.
  int num_orbits = 0;           ///< Of a run.
  std::uint64_t num_steps = 0;  ///< Of a run: samples, settling included.
  std::vector<SetCost> sets;    ///< `scalar` first.
  StepCost scalar_step;
  StartCost start;
  SpentTime spent;                      ///< On the runs of all sets.
  std::vector<CampaignCost> campaigns;  ///< Empty if they were not asked for.
};

/// Measures noise alone, for one run; for a set with lanes, of a full batch.
[[nodiscard]] NoiseCost measure_noise(const MicroscopeCampaign& campaign, InstructionSet set);

/// Measures the parts of a scalar step, in one session; `noise_ns` and `whole_ns` are left 0.
[[nodiscard]] StepCost measure_step_parts(const MicroscopeCampaign& campaign);

/// True if both are the same to the last bit: −0 is not 0, and a NaN is itself.
[[nodiscard]] bool agree_to_the_bit(const RunResult& a, const RunResult& b);

/// Compares results with those of the same runs that are known, in the same order, and makes those
/// of further runs known.
/// @return True if none differs.
[[nodiscard]] bool agree_with_known(std::span<const RunResult> results,
                                    std::vector<RunResult>& known);

}  // namespace proofmass::test
