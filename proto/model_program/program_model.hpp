#pragma once

#include <filesystem>
#include <memory>

#include "core/model.hpp"

namespace proofmass::wire {

/// The model of a program in any language, which is asked what it is and then not kept.
/// README.md has what is asked and answered.
/// @throws ModelProgramError if it cannot be started or does not answer; DefinitionError naming the
///         program if its description breaks a rule.
[[nodiscard]] std::unique_ptr<const Model> model_of(const std::filesystem::path& program);

}  // namespace proofmass::wire
