#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/output.hpp"
#include "coordinator/table/terminal_table.hpp"
#include "core/model.hpp"
#include "proto/model_program/model_choice.hpp"

namespace proofmass::coordinator {
namespace {

struct ModelsOptions {
  OutputFormat format = OutputFormat::text;
};

std::string digest_text(const Model& model) {
  return fmt::format("{:016x}", model.reference_digest(best_instruction_set()));
}

Table models_table() {
  Table table{.columns = {{.title = "model", .is_text = true},
                          {.title = "version", .is_text = true},
                          {.title = "drawn"},
                          {.title = "results"},
                          {.title = "digest", .is_text = true},
                          {.title = "program", .is_text = true}}};
  for (const Model* const model : models()) {
    const auto program = wire::program_of(*model);
    table.rows.push_back({std::string(name_of_model(model->version())),
                          std::string(model->version()), fmt::to_string(model->drawn().size()),
                          fmt::to_string(model->results_of({}, model->version()).quantities.size()),
                          digest_text(*model), program ? program->string() : "built in"});
  }
  return table;
}

nlohmann::ordered_json models_json() {
  auto list = nlohmann::ordered_json::array();
  for (const Model* const model : models()) {
    const auto program = wire::program_of(*model);
    list.push_back({{"name", name_of_model(model->version())},
                    {"version", model->version()},
                    {"purpose", model->purpose()},
                    {"num_drawn", model->drawn().size()},
                    {"num_results", model->results_of({}, model->version()).quantities.size()},
                    {"reference_digest", digest_text(*model)},
                    {"program", program ? nlohmann::ordered_json(program->string()) : nullptr}});
  }
  return list;
}

int list_models(const ModelsOptions& options) {
  if (options.format == OutputFormat::json) {
    print_json(models_json());
  } else {
    write_standard_output(terminal_text(models_table(), style_of(stdout)));
  }
  return exit_done;
}

}  // namespace

void add_models(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<ModelsOptions>(
      app, chosen, "models", "List the models that campaigns can be of here", list_models);
  add_json_flag(command, options.format);
}

}  // namespace proofmass::coordinator
