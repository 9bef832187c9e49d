// The models that campaigns can be of, and the files that they write for campaigns.

#include <fmt/format.h>

#include <filesystem>
#include <string>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/shared_options.hpp"
#include "coordinator/report/json.hpp"
#include "coordinator/table/terminal_table.hpp"
#include "core/model.hpp"
#include "proto/command_line/option_checks.hpp"
#include "proto/model_program/model_choice.hpp"

namespace proofmass::coordinator {
namespace {

struct InitOptions {
  std::filesystem::path file = model().example_file();
  wire::IfThere if_there = wire::IfThere::keep;
};

int write_example(const InitOptions& options) {
  check_document(options.file, options.if_there);
  write_document(options.file, options.if_there, model().example());
  if (options.file != "-") fmt::print("wrote {}\n", options.file.string());
  return exit_done;
}

struct EnvironmentOptions {
  std::filesystem::path file;
  Overrides overrides;
  EnvironmentRequest request;
  std::filesystem::path output;
  wire::IfThere if_there = wire::IfThere::keep;
};

int write_environment(const EnvironmentOptions& options) {
  check_document(options.output, options.if_there);
  const auto [text, note] = environment_file(options.file, options.overrides, options.request);
  if (text.empty()) {
    throw UsageError(
        fmt::format("{}: campaigns of this model have no environment file", options.file.string()));
  }
  write_document(options.output, options.if_there, text);
  if (options.output != "-") fmt::print("wrote {}\n", options.output.string());
  if (!note.empty()) wire::say(fmt::format("proofmass: warning: {}\n", note));
  return exit_done;
}

struct ModelsOptions {
  OutputFormat format = OutputFormat::text;
};

Json models_json() {
  auto list = Json::array();
  for (const Model* const model : models()) {
    const std::uint64_t digest = model->reference_digest(best_instruction_set());
    const auto program = wire::program_of(*model);
    list.push_back({{"name", name_of_model(model->version())},
                    {"version", model->version()},
                    {"purpose", model->purpose()},
                    {"num_drawn", model->drawn().size()},
                    {"num_results", model->results_of({}, model->version()).quantities.size()},
                    {"reference_digest", fmt::format("{:016x}", digest)},
                    {"program", program ? Json(program->string()) : nullptr}});
  }
  return list;
}

Table models_table() {
  Table table{.columns = {{.title = "model", .is_text = true},
                          {.title = "version", .is_text = true},
                          {.title = "drawn"},
                          {.title = "results"},
                          {.title = "digest", .is_text = true},
                          {.title = "program", .is_text = true}}};
  const auto text_of = [](const Json& value) {
    return value.is_string() ? value.get<std::string>() : value.dump();
  };
  for (const Json& model : models_json()) {
    Row& row = table.rows.emplace_back();
    for (const char* const key :
         {"name", "version", "num_drawn", "num_results", "reference_digest"}) {
      row.emplace_back(text_of(model[key]));
    }
    row.emplace_back(model["program"].is_null() ? "built in" : text_of(model["program"]));
  }
  return table;
}

int list_models(const ModelsOptions& options) {
  if (options.format == OutputFormat::json) {
    print_json(models_json());
  } else {
    TerminalStyle style = style_of(stdout);
    style.wraps_cells = true;
    write_standard_output(terminal_text(models_table(), style));
  }
  return exit_done;
}

}  // namespace

void add_init(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<InitOptions>(
      app, chosen, "init", "Write an example of a campaign file, commented", write_example);
  command.add_option("FILE", options.file, "File to write; - for standard output")
      ->type_name(campaign_file_type)
      ->capture_default_str();
  add_force_flag(command, options.if_there);
}

void add_environment(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<EnvironmentOptions>(
      app, chosen, "environment", "Compute an environment file from physics", write_environment);
  add_campaign_file(command, options.file);
  command.add_option("--output", options.output, "File (CSV) to write; - for standard output")
      ->type_name(wire::file_type)
      ->required();
  command
      .add_option("--session", options.request.session,
                  "Session that it is for, if their spins differ")
      ->type_name("NAME");
  command.add_option("--physics", options.request.physics, "File (TOML) of what is not nominal")
      ->type_name(wire::file_type);
  add_force_flag(command, options.if_there);
  add_override_options(command, options.overrides);
}

void add_models(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<ModelsOptions>(
      app, chosen, "models", "List the models that campaigns can be of here", list_models);
  add_json_flag(command, options.format);
}

}  // namespace proofmass::coordinator
