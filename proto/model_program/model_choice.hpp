#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace CLI {
class App;
}  // namespace CLI

namespace proofmass {
class Model;
}  // namespace proofmass

namespace proofmass::wire {

/// What becomes of a program of which model_of() makes no model.
enum class Broken : std::uint8_t { refused, left_out };

/// Puts the models of the programs before the built-in one which the options `--model-program PATH`
/// or, without any, the variable PROOFMASS_MODEL_PROGRAM name, the latter with colons between them.
/// To be called first, by one thread: help texts and options depend on the models.
/// @param say  Told if a program takes long to say what it is.
/// @return Of each program that is left out, what is wrong with it.
/// @throws What model_of() does; InvalidArgument if two have one version.
[[nodiscard]] std::vector<std::string> choose_models(
    int argc, const char* const* argv, Broken broken,
    const std::function<void(const std::string&)>& say);

/// Appends the options that name the programs of choose_models(), for a program that this process
/// starts.
void add_model_programs(std::vector<std::string>& arguments);

/// The program of one of models(), if it has one.
[[nodiscard]] std::optional<std::filesystem::path> program_of(const Model& model);

/// Most runs that a worker's thread computes together, of any of models(): its slots.
[[nodiscard]] std::size_t slots_per_thread();

/// Declares `--model-program`, which choose_models() has followed; a file of options cannot set it.
void add_model_program_option(CLI::App& app);

}  // namespace proofmass::wire
