#include "proto/model_program/model_choice.hpp"

#include <CLI/CLI.hpp>
#include <cstdlib>
#include <memory>
#include <string>
#include <string_view>

#include "core/error.hpp"
#include "proto/command_line/option_checks.hpp"
#include "proto/link/surroundings.hpp"
#include "proto/model_program/program_model.hpp"

namespace proofmass::wire {
namespace {

constexpr std::string_view option = "--model-program";
constexpr const char* variable = "PROOFMASS_MODEL_PROGRAM";

struct Choice {
  std::filesystem::path program;
  std::unique_ptr<const Model> model;
};

std::optional<Choice>& choice() {
  static std::optional<Choice> choice;
  return choice;
}

}  // namespace

void choose_model(int argc, const char* const* argv) {
  const char* named = std::getenv(variable);
  for (int i = 1; i < argc; ++i) {
    const std::string_view argument = argv[i];
    if (!argument.starts_with(option)) continue;
    if (argument.size() == option.size() && i + 1 < argc) named = argv[i + 1];
    if (argument.substr(option.size()).starts_with('=')) named = argv[i] + option.size() + 1;
  }
  if (named == nullptr || *named == '\0') return;
  settle_surroundings();  // Its pipes are to be no standard descriptors.
  const std::filesystem::path program = std::filesystem::absolute(named).lexically_normal();
  choice() = Choice{.program = program, .model = model_of(program)};
  use_model(*choice()->model);
}

std::optional<std::filesystem::path> chosen_model_program() {
  if (!choice()) return std::nullopt;
  return choice()->program;
}

void add_model_program_option(CLI::App& app) {
  app.add_option_function<std::string>(
         std::string(option),
         [](const std::string& named) {
           const std::filesystem::path program = std::filesystem::absolute(named);
           if (chosen_model_program() == program.lexically_normal()) return;
           throw InvalidArgument("model-program = " + named +
                                 " (must be an argument or the variable " + variable +
                                 ", as it decides what other options mean)");
         },
         "Program that simulates in place of the built-in\nmodel")
      ->type_name(file_type)
      ->envname(variable);
}

}  // namespace proofmass::wire
