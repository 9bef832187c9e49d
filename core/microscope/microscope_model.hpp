#pragma once

#include "core/model.hpp"

namespace proofmass {

/// The model of MICROSCOPE's calibration and test of the equivalence principle.
[[nodiscard]] const Model& microscope_model();

}  // namespace proofmass
