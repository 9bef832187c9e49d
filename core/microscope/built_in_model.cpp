// The programs of this tree have MICROSCOPE's model alone.

#include "core/microscope/microscope_model.hpp"

namespace proofmass {

const Model& built_in_model() { return microscope_model(); }

std::vector<const Model*> further_models() { return {}; }

}  // namespace proofmass
