#pragma once

#include "core/error.hpp"

namespace proofmass {

/// What simulates runs, outside this process, has crashed, hangs, or yields what no simulation
/// does. Nothing is known of the runs. A worker gives them back so: each has as many attempts as if
/// the worker had crashed, which goes on with its other runs.
class SimulationCrash : public Error {
 public:
  using Error::Error;
};

}  // namespace proofmass
