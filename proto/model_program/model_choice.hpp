#pragma once

#include <filesystem>
#include <optional>

namespace CLI {
class App;
}  // namespace CLI

namespace proofmass::wire {

/// Makes model() that of the program which the option `--model-program PATH` or the variable
/// PROOFMASS_MODEL_PROGRAM names; leaves it as it is if there is neither. To be called first, by
/// one thread: help texts and options depend on the model.
/// @throws ModelProgramError as model_of() does.
void choose_model(int argc, const char* const* argv);

/// The program of choose_model(), for workers that this process starts.
[[nodiscard]] std::optional<std::filesystem::path> chosen_model_program();

/// Declares `--model-program`, which choose_model() has followed; a file of options cannot set it.
void add_model_program_option(CLI::App& app);

}  // namespace proofmass::wire
