#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "core/microscope/estimation/joint/joint_model.hpp"
#include "core/microscope/estimation/methods.hpp"

namespace proofmass {

/// Estimates all parameters at once from all informative lines of all sessions: weighted least
/// squares by Gauss and Newton's iteration, with nuisances that have priors. README.md derives the
/// model of a line, the weights and the priors.
///
/// The standard errors are those of the fit: noise, and what the nuisances may be. Without noise
/// (noise.scale 0) they are those of scale 1.
[[nodiscard]] Estimation estimate_joint(const RunPhasors& records, const EstimationInput& input);

/// What the fit of a run tells of the unknowns.
class JointInformation {
 public:
  /// Arguments as of estimate_joint().
  /// @param unknowns  Of the instrument: the model is linearised about them.
  JointInformation(const RunPhasors& records, const EstimationInput& input,
                   const UnknownArray& unknowns);

  /// Standard errors, SI, if the lines of each session told so many times as much: what they tell
  /// is in proportion to the length of the record.
  /// @param known  A nuisance that shall be known beforehand.
  [[nodiscard]] ParameterArray standard_errors(std::span<const double> factors,
                                               std::optional<Unknown> known = std::nullopt) const;

  /// The normal matrix of the same: the unknowns in the order of Unknown, each in a unit of its
  /// own.
  [[nodiscard]] Eigen::MatrixXd information(std::span<const double> factors) const;

 private:
  std::vector<Eigen::MatrixXd> sessions_;  ///< Normal matrices, in `units_`.
  Eigen::MatrixXd beside_;                 ///< Of priors, and of what no session's lines tell.
  ParameterArray units_;                   ///< SI.
};

/// factor·f of an excitation plus orbital·f_orb.
[[nodiscard]] LineMultiple excitation_multiple(std::size_t excitation, double factor,
                                               double orbital = 0.0);

/// 2 f_orb, the line of each angular and each drag-free excitation, 2 f of what is shaken along X,
/// and f ± 2 f_orb of masses that move in opposition along Y or Z.
[[nodiscard]] RecordNeeds joint_needs(const Session& session);

/// What a session does that determines a parameter: `pushes along y`. Empty for the two that every
/// session determines if it is long enough.
[[nodiscard]] std::string_view what_determines(Parameter parameter);

/// @throws ConfigError if a session spins, or if no session has an excitation that a parameter
///         needs.
void check_joint(const std::vector<Session>& sessions);

/// Least orbits of a session of which the record, less the transient, is one orbit long: in a
/// shorter one the lines at f_orb, 2 f_orb and 3 f_orb and the level cannot be told apart, and
/// errors are larger than the standard errors (README.md).
[[nodiscard]] int joint_orbits_min(double orbit_period_s, double transient_s);

/// @throws ConfigError if a session that calibrates has fewer orbits than joint_orbits_min().
void check_joint_records(const std::vector<Session>& sessions, double orbit_period_s,
                         double transient_s);

/// Largest amplitude of a push, m/s², where what the model leaves out moves a_d11' by a fiftieth of
/// its objective if K2 is as large as it is drawn (root mean square). README.md derives both, and
/// says why the lower one holds beside motions.
struct PushLimits {
  double alone_along_x;  ///< Of a push along X if nothing else pushes or moves.
  double beside_others;  ///< Of a push along X beside another push or motion.
};
[[nodiscard]] PushLimits push_limits(const DrawnMoments& laws, double a_d11_objective);

/// Whether what_determines() a parameter could have a larger amplitude in one of the sessions;
/// false if that is empty.
[[nodiscard]] bool may_be_larger(const std::vector<Session>& sessions, Parameter parameter,
                                 const PushLimits& limits);

/// Largest amplitude of a moving mass, m: what it makes of the noise of the estimated attitude is
/// not in the standard errors (README.md).
inline constexpr double joint_motion_max_m = 2e-5;

/// @throws ConfigError if a mass moves farther.
void check_joint_motions(const std::vector<Session>& sessions);

/// Largest eccentricity: the model is of first order in it (README.md).
inline constexpr double joint_eccentricity_max = 0.03;

/// @throws ConfigError if a push is stronger.
void check_joint_pushes(const std::vector<Session>& sessions, const PushLimits& limits);

inline constexpr EstimationMethodInfo joint_method{
    .name = "joint",
    .needs = joint_needs,
    .check = check_joint,
    .estimate = estimate_joint,
    .has_standard_errors = true,
};

}  // namespace proofmass
