#include "proto/model_program/model_choice.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdlib>
#include <memory>
#include <string>
#include <string_view>

#include "core/error.hpp"
#include "proto/command_line/option_checks.hpp"
#include "proto/model_program/program_model.hpp"
#include "proto/wire/messages.hpp"

namespace proofmass::wire {
namespace {

constexpr std::string_view option = "--model-program";
constexpr const char* variable = "PROOFMASS_MODEL_PROGRAM";

struct ChosenModel {
  std::filesystem::path program;
  std::unique_ptr<const Model> model;
};

std::vector<ChosenModel>& chosen_models() {
  static std::vector<ChosenModel> chosen;
  return chosen;
}

/// Of the arguments, or else of the variable, with colons between them.
std::vector<std::string> named_programs(int argc, const char* const* argv) {
  std::vector<std::string> programs;
  for (int i = 1; i < argc; ++i) {
    const std::string_view argument = argv[i];
    if (!argument.starts_with(option)) continue;
    if (argument.size() == option.size() && i + 1 < argc) programs.emplace_back(argv[i + 1]);
    if (argument.substr(option.size()).starts_with('=')) {
      programs.emplace_back(argument.substr(option.size() + 1));
    }
  }
  const char* const listed = std::getenv(variable);
  if (!programs.empty() || listed == nullptr) return programs;
  programs = CLI::detail::split(listed, ':');
  std::erase(programs, "");
  return programs;
}

}  // namespace

std::vector<std::string> choose_models(int argc, const char* const* argv, Broken broken,
                                       const std::function<void(const std::string&)>& say) {
  std::vector<ChosenModel>& chosen = chosen_models();
  std::vector<const Model*> used;
  std::vector<std::string> left_out;
  for (const std::string& named : named_programs(argc, argv)) {
    if (named.empty()) throw InvalidArgument("model-program = \"\" (must name a file)");
    const std::filesystem::path program = std::filesystem::absolute(named).lexically_normal();
    if (std::ranges::find(chosen, program, &ChosenModel::program) != chosen.end()) continue;
    std::unique_ptr<const Model> model;
    try {
      model = model_of(program, [&] {
        say(fmt::format("waiting until {} describes itself; a program must flush each answer",
                        named));
      });
    } catch (const Error& error) {
      if (broken == Broken::refused) throw;
      left_out.emplace_back(error.what());
      continue;
    }
    const auto has_its_version = [&](const Model* other) {
      return other->version() == model->version();
    };
    if (has_its_version(&built_in_model()) || std::ranges::any_of(used, has_its_version)) {
      throw InvalidArgument(fmt::format("model-program = {} (is {}, as another model that is here)",
                                        named, model->version()));
    }
    if (used.size() == other_models_max) {
      throw InvalidArgument(
          fmt::format("model-program = {} (must be at most {} programs)", named, other_models_max));
    }
    used.push_back(model.get());
    chosen.push_back({.program = program, .model = std::move(model)});
  }
  use_models(std::move(used));
  return left_out;
}

void add_model_programs(std::vector<std::string>& arguments) {
  for (const ChosenModel& chosen : chosen_models()) {
    arguments.insert(arguments.end(), {std::string(option), chosen.program.string()});
  }
}

std::optional<std::filesystem::path> program_of(const Model& model) {
  for (const ChosenModel& chosen : chosen_models()) {
    if (chosen.model.get() == &model) return chosen.program;
  }
  return std::nullopt;
}

std::size_t slots_per_thread() {
  std::size_t most = 1;
  for (const Model* const model : models()) most = std::max(most, model->batch_size());
  return most;
}

void add_model_program_option(CLI::App& app) {
  static std::vector<std::string> followed;  // By choose_models().
  app.add_option(std::string(option), followed,
                 "Program that simulates a model of its own; may be\ngiven several times")
      ->type_name(file_type)
      ->envname(variable)
      ->allow_extra_args(false)
      ->configurable(false);
}

}  // namespace proofmass::wire
