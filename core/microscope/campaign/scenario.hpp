#pragma once

#include <algorithm>
#include <cstddef>
#include <optional>
#include <string_view>
#include <vector>

#include "core/campaign/field.hpp"
#include "core/microscope/campaign/budget.hpp"
#include "core/microscope/control/control_config.hpp"
#include "core/microscope/control/controller.hpp"
#include "core/microscope/control/realism_config.hpp"
#include "core/microscope/environment/environment_config.hpp"
#include "core/microscope/estimation/estimation_config.hpp"
#include "core/microscope/instrument/instrument_config.hpp"
#include "core/microscope/instrument/noise_config.hpp"
#include "core/microscope/orbit/kepler_orbit.hpp"
#include "core/microscope/results/results.hpp"
#include "core/microscope/session/gaps.hpp"
#include "core/microscope/session/session.hpp"

namespace proofmass {

/// Everything that defines the runs of a campaign apart from seed, number and dispersions. Each
/// member is the table of that name of a campaign file; its structure stands in the header of its
/// module and holds the nominal values.
struct Scenario {
  OrbitConfig orbit;
  SimulationConfig simulation;
  EnvironmentConfig environment;
  NoiseConfig noise;
  DragFreeConfig drag_free;
  AttitudeConfig attitude;
  SensorConfig sensor;
  GapsConfig gaps;                            ///< Of campaigns that test.
  std::optional<RealismConfig> realism;       ///< Of campaigns that have the table.
  std::vector<ControllerConfig> controllers;  ///< Of an axis of a loop each; nominal where none is.
  EstimationConfig estimation;
  AcceptanceConfig acceptance;    ///< Bounds outside which an instrument is drawn again.
  BudgetConfig budget;            ///< Levels behind the error budget; the simulation uses none.
  ParameterArray objectives;      ///< SI, > 0; [Hardy2013] tab:perfo-numerical by default.
  TestArray test_objectives;      ///< SI, > 0; of campaigns that test.
  std::vector<Session> sessions;  ///< In the order in which they are simulated and recorded.

  Scenario();  ///< The nominal scenario.

  /// True if a session tests the equivalence principle.
  [[nodiscard]] bool has_tests() const { return std::ranges::any_of(sessions, is_test); }

  /// True if satellite and loops are the paper's, for which there are compiled kernels.
  [[nodiscard]] bool has_plain_loops() const { return !realism && controllers.empty(); }

  /// Checks each number against its range, and what has to hold between several: the loops against
  /// the sample rate, the sessions' lines against the Nyquist frequency, the sessions against the
  /// estimation method.
  /// @throws ConfigError naming the field, its value and the rule.
  void validate() const;
};

/// Calls visit(FieldInfo, value) for every number and choice of the scenario except its sessions,
/// in file order; for those of a test only if the scenario has_tests(), for those of its realism
/// only if it has that. `Config` is Scenario or const Scenario; the value is a (const) reference to
/// double, std::int64_t or one of the enumerations above. The FieldInfo lives during the call.
template <typename Config, typename Visitor>
void for_each_field(Config& scenario, Visitor&& visit);

}  // namespace proofmass

#include "core/microscope/campaign/scenario_fields.hpp"
