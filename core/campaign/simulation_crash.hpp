#pragma once

#include "core/error.hpp"

namespace proofmass {

/// What simulates runs has crashed, hangs, or yields what no simulation does. Nothing is known of
/// the runs: a worker that sees one ends as if it had crashed itself, so that each run has as many
/// attempts as with any crash.
class SimulationCrash : public Error {
 public:
  using Error::Error;
};

}  // namespace proofmass
