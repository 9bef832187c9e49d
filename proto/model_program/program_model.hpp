#pragma once

#include <filesystem>
#include <functional>
#include <memory>

#include "core/model.hpp"

namespace proofmass::wire {

/// The model of a program in any language, which is asked what it is, and kept for what it is asked
/// next. README.md has what is asked and answered.
/// @param on_silence  Called once if the program takes long to say what it is.
/// @throws ModelProgramError if it cannot be started or does not answer; DefinitionError naming the
///         program if its description breaks a rule.
[[nodiscard]] std::unique_ptr<const Model> model_of(const std::filesystem::path& program,
                                                    std::function<void()> on_silence = {});

/// Ends the programs that model_of(), and plans that computed no run, have kept: before what may
/// take long and does not need them, and before a fork, after which two would talk to them.
void end_fresh_programs();

}  // namespace proofmass::wire
