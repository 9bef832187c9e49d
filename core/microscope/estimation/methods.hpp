#pragma once

#include "core/microscope/estimation/method.hpp"

namespace proofmass {

/// @pre method is one of names_of(EstimationMethod), which Scenario::validate() checks.
[[nodiscard]] const EstimationMethodInfo& estimation_method(EstimationMethod method);

}  // namespace proofmass
