// Programs with a model of one's own have that of MICROSCOPE as well.

#include "core/microscope/microscope_model.hpp"

namespace proofmass {

std::vector<const Model*> further_models() { return {&microscope_model()}; }

}  // namespace proofmass
