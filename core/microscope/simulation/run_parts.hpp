#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "core/microscope/campaign/microscope_campaign.hpp"
#include "core/microscope/campaign/shift_bounds.hpp"
#include "core/microscope/environment/environment.hpp"
#include "core/microscope/estimation/ep_test/window_weights.hpp"
#include "core/microscope/estimation/methods.hpp"
#include "core/microscope/orbit/kepler_orbit.hpp"
#include "core/microscope/simulation/line_fit.hpp"
#include "core/microscope/simulation/recorded_signals.hpp"
#include "core/microscope/simulation/run.hpp"
#include "core/microscope/simulation/sample_noise.hpp"
#include "core/microscope/simulation/session_record.hpp"
#include "core/signal/line_weights.hpp"

namespace proofmass {

/// What all runs of a campaign share, for those that simulate them: filters, weights, orbit,
/// environment. Sessions are given by their index in the scenario.
struct RunParts {
  /// @pre campaign.validate() passed, and so did m.check() for its sessions.
  RunParts(const MicroscopeCampaign& c, const EstimationMethodInfo& m);

  [[nodiscard]] bool is_monitored(std::size_t i) const { return residual_weights[i].has_value(); }

  /// Makes the weights of a session, block by block.
  struct Readers {
    Readers(const RunParts& parts, std::size_t i)
        : lines(parts.weights[i]),
          buffer(weights_buffer_size(lines.weights().num_fit_lines(), parts.groups[i].size())) {
      for (std::size_t g = 0; g < parts.groups[i].size(); ++g) {
        further.push_back({WeightReader(parts.group_weights[i][g]), parts.groups[i][g].signals});
      }
      if (parts.is_monitored(i)) residual.emplace(*parts.residual_weights[i]);
    }
    WeightReader lines;
    std::vector<LineReader> further;  ///< Of the lines that the method asks for.
    std::vector<double> buffer;
    std::optional<WeightReader> residual;  ///< Of a session that is monitored.
  };

  [[nodiscard]] SessionSetup setup(std::size_t i, Readers& readers) const;

  /// lost_blocks() of a run's session; none unless it tests.
  [[nodiscard]] std::vector<bool> lost(std::size_t i, RunIndex run) const;

  /// Weights of the windows of a run's session; none unless it tests.
  /// @param room  Outlives them.
  [[nodiscard]] std::span<const float> window_weights(std::size_t i, RunIndex run,
                                                      std::vector<float>& room) const;

  /// SessionPhasors::test_noise of a run's session that tests.
  [[nodiscard]] RegressorProducts window_noise(std::size_t i, RunIndex run) const;

  /// What is known of a run before it is simulated.
  [[nodiscard]] RunRecord drawn_record(RunIndex run, const AcceptedDraw& draw) const;

  /// Keeps what a session left of a run.
  void keep(std::size_t i, const SessionOutcome& outcome, RunRecord& record) const;

  MicroscopeCampaign campaign;
  EstimationMethodInfo method;
  DrawnMoments laws;  ///< Of what is drawn.
  KeplerOrbit orbit;
  Environment environment;
  NoiseModel noise;
  DragFreeGains drag_free;
  AttitudeGains attitude;
  ShiftBounds bounds;
  Recording recording;
  std::vector<LineWeights> weights;                          ///< Of each session.
  std::vector<RecordNeeds> needs;                            ///< Of each session.
  std::vector<std::vector<LineGroup>> groups;                ///< Of each session's further lines.
  std::vector<std::vector<LineWeights>> group_weights;       ///< Of those groups.
  std::vector<std::optional<LineWeights>> residual_weights;  ///< Of those that are monitored.
  std::vector<TestSetup> tests;  ///< Of each session; of use where it is a test.
  WindowWeights weights_of_windows;
  /// Of each session; none unless it tests and loses data.
  std::vector<std::vector<WindowRegressors>> regressors;
  /// Of each session, if none loses data: what runs have in common.
  std::vector<std::vector<float>> weights_of_complete;
  std::vector<RegressorProducts> noise_of_complete;

  /// Whether the masses of any session feel stiffness.
  [[nodiscard]] bool has_stiffness() const;

 private:
  /// The regressors of a test in the attitude that it is to have.
  [[nodiscard]] std::vector<WindowRegressors> nominal_regressors(std::size_t i) const;

  /// True if the loops of a session without excitation are those of one before, which tells enough.
  [[nodiscard]] bool is_monitored_before(std::size_t i) const;
};

}  // namespace proofmass
