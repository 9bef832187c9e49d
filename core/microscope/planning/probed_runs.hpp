#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "core/campaign/plan_study.hpp"
#include "core/microscope/campaign/microscope_campaign.hpp"
#include "core/microscope/simulation/run.hpp"

namespace proofmass {

/// The campaign with as few orbits of each session as leave its lines what they are: three, if
/// these can be told apart in so few.
[[nodiscard]] MicroscopeCampaign short_campaign(MicroscopeCampaign campaign);

/// Runs of a campaign that are simulated before it is, with noise and the campaign's loops: the
/// first orbits of every session, also of those that test. README.md says what they show.
class ProbedRuns {
 public:
  /// Simulates the first 16 of the runs; 4 if the loops are not the paper's.
  /// @param campaign  Estimated by `joint`, which its calibration suits.
  /// @param runs      That have an instrument.
  ProbedRuns(const MicroscopeCampaign& campaign, const std::vector<RunIndex>& runs);

  [[nodiscard]] std::size_t size() const { return probes_.size(); }

  /// Runs whose data do not fit the model of `joint`, beyond chance. All of them if none is one by
  /// itself and they are together: so smaller misfits are seen.
  [[nodiscard]] std::size_t num_misfits() const;

  /// Sessions whose data of all probed runs together do not fit: their names.
  [[nodiscard]] const std::vector<std::string>& misfit_sessions() const { return misfit_sessions_; }

  /// ErrorBudget::level that the runs that are not lost have in common, m/s²; 0 if no session tells
  /// it.
  [[nodiscard]] double level_m_s2() const { return level_m_s2_; }

  /// Finds losses and warnings of the runs.
  /// @param scenario  Of the campaign, with any lengths of its sessions.
  /// @param errors    Standard errors with these lengths, SI; of each run, or of more.
  void judge(const Scenario& scenario, const std::vector<ParameterArray>& errors,
             PlanBound& bound) const;

 private:
  struct Probe {
    RunRecord record;
    bool has_converged = false;
    bool is_misfit = false;
  };

  DispersionSet dispersions_;
  std::vector<int> num_orbits_;  ///< Of each session, as simulated.
  std::vector<Probe> probes_;
  bool do_fit_together_ = true;
  std::vector<std::string> misfit_sessions_;
  double level_m_s2_ = 0.0;
};

}  // namespace proofmass
