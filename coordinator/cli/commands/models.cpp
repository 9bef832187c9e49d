#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <ctime>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/commands/run.hpp"
#include "coordinator/report/json.hpp"
#include "coordinator/report/read_results.hpp"
#include "coordinator/report/report.hpp"
#include "coordinator/table/table.hpp"
#include "core/campaign/campaign.hpp"
#include "core/math/instruction_set.hpp"
#include "core/model.hpp"
#include "proto/command_line/option_checks.hpp"
#include "proto/link/machine.hpp"
#include "proto/model_program/described_model.hpp"
#include "proto/model_program/model_choice.hpp"

// The models that campaigns can be of, and the files that they write for campaigns.

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
  std::filesystem::path physics;
  std::string session;
  std::filesystem::path output;
  wire::IfThere if_there = wire::IfThere::keep;
};

int write_environment(const EnvironmentOptions& options) {
  check_document(options.output, options.if_there);
  check_no_input(options.output, {options.file, options.physics});
  const auto [text, note] =
      environment_file(options.file, options.overrides, options.physics, options.session);
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
  add_path(command, campaign_file_type, "FILE", options.file,
           "File to write; - for standard output")
      ->capture_default_str();
  add_force_flag(command, options.if_there);
}

void add_environment(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<EnvironmentOptions>(
      app, chosen, "environment", "Compute an environment file from physics", write_environment);
  add_campaign_file(command, options.file);
  add_path(command, wire::file_type, "--output", options.output,
           "File (CSV) to write; - for standard output")
      ->required();
  command.add_option("--session", options.session, "Session that it is for, if their spins differ")
      ->type_name("NAME");
  add_path(command, wire::file_type, "--physics", options.physics,
           "File (TOML) of what is not nominal");
  add_force_flag(command, options.if_there);
  add_override_options(command, options.overrides);
}

void add_models(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<ModelsOptions>(
      app, chosen, "models", "List the models that campaigns can be of here", list_models);
  add_json_flag(command, options.format);
}

namespace {

struct CheckOptions {
  std::filesystem::path file;
  Overrides overrides;
  OutputFormat format = OutputFormat::text;
};

/// A file that lacks what its author thinks is in it shows here: what is left out is nominal.
std::string differences_text(const std::vector<DefinitionDifference>& differences) {
  if (differences.empty())
    return "Beside the number of runs, nothing differs from what `proofmass init` writes.\n";
  std::string text = "Beside the number of runs, these differ from what `proofmass init` writes:\n";
  for (const auto& [field, own, example] : differences) {
    text += fmt::format("  {} = {} (instead of {})\n", field, own, example);
  }
  return text;
}

/// What can be said of the first runs without computing many.
struct Outlook {
  std::uint64_t num_drawn = 0;  ///< Instruments, one for all realisations of its noise.
  std::uint64_t num_draws = 0;  ///< Of these.
  std::uint64_t num_without_draw = 0;
  double batch_s = 0.0;
  std::size_t num_simulated = 0;                       ///< Runs; 0 if they take too long.
  MissingEstimates missing;                            ///< Of these.
  std::vector<DefinitionDifference> differences = {};  ///< From the example.
};

Outlook outlook_on(const Campaign& campaign, const Plan& plan) {
  constexpr std::uint64_t instruments_max = 1000,
                          draws_max = 20'000;  // Some hundredths of a second.
  const FirstBatch batch = try_first_batch(campaign, plan);
  Outlook outlook{.batch_s = batch.time_s, .num_simulated = batch.results.size(), .missing = {}};
  for (const RunResult& result : batch.results) outlook.missing.add(result);
  // The program that accepts the example may be the one that computes a run again.
  outlook.differences = campaign.differences_from(*example_campaign(campaign.model()));
  const bool is_program = !campaign.model().description().empty();
  if (is_program) wire::require_repeatable(campaign, *campaign.prepare(), batch.results.back());
  const std::uint64_t each = campaign.realisations;
  const std::uint64_t num_instruments = (campaign.num_runs + each - 1) / each;
  for (; outlook.num_drawn < std::min(num_instruments, instruments_max) &&
         outlook.num_draws < draws_max;
       ++outlook.num_drawn) {
    const std::uint64_t run = outlook.num_drawn * each;
    const RunDraw draw = campaign.draw(RunIndex{run});
    outlook.num_draws += draw.num_draws;
    if (draw.truth.empty()) ++outlook.num_without_draw;
  }
  return outlook;
}

/// Empty for a campaign that `plan` knows no more of.
std::string advice_to_plan(const CheckOptions& options, const Campaign& campaign) {
  if (!campaign.model().can_study(campaign)) return "";
  // Without them it would tell of another campaign.
  std::string command = "proofmass plan " + wire::shell_word(options.file.string());
  for (const std::string& assignment : options.overrides.assignments) {
    command += " --set " + wire::shell_word(assignment);
  }
  if (options.overrides.seed) command += fmt::format(" --seed {}", *options.overrides.seed);
  return fmt::format("see `{}`", command);
}

std::string outlook_text(const CheckOptions& options, const Campaign& campaign,
                         const Outlook& outlook) {
  std::string text =
      fmt::format("Draws     {} of {} accepted, for the first {} {}\n",
                  outlook.num_drawn - outlook.num_without_draw, outlook.num_draws,
                  outlook.num_drawn, campaign.realisations > 1 ? "instruments" : "runs");
  const std::uint32_t num_draws_max = campaign.results().num_draws_max;
  if (outlook.num_without_draw > 0 && num_draws_max == 1) {  // The model has no bounds.
    text += fmt::format(
        "Warning   {} of these end without an estimate: a truth or a derived value is no\n"
        "          number, or beyond {:g}; correct its expression or narrow the laws\n",
        outlook.num_without_draw, magnitude_max);
  } else if (outlook.num_without_draw > 0) {
    text += fmt::format(
        "Warning   {} of these find none in {} draws and end without an estimate:\n"
        "          widen the bounds or narrow the laws\n",
        outlook.num_without_draw, num_draws_max);
  }
  const std::uint64_t each = campaign.realisations, rest = campaign.num_runs % each;
  if (rest > 0) {
    text += fmt::format(
        "Warning   the last draw has {} of its {} runs, and intervals by instrument leave it out; "
        "use "
        "--runs {}\n",
        rest, each, campaign.num_runs - rest + each);
  }
  if (outlook.num_simulated == 0) {
    const std::string advice = advice_to_plan(options, campaign);
    return text + "Losses    not tried, as runs are long" + (advice.empty() ? "" : "; " + advice);
  }
  const std::string reasons = reasons_text(outlook.missing);
  text +=
      fmt::format("Losses    {} of the first {} runs{}{}", outlook.missing.total(),
                  outlook.num_simulated, reasons.empty() ? "" : ", without an estimate: ", reasons);
  if (outlook.missing.num_lost == 0) return text;
  const std::string advice = advice_to_plan(options, campaign);
  if (!advice.empty()) text += ";\n          for the cause " + advice;
  return text;
}

Json check_json(const CheckOptions& options, const Campaign& campaign, const Plan& plan,
                const Outlook& outlook, const CostEstimate& cost) {
  const auto of_difference = [](const DefinitionDifference& of) -> Json {
    return {{"field", of.field}, {"value", of.first}, {"example", of.second}};
  };
  return {{"file", options.file.string()},
          {"campaign", campaign.name},
          {"seed", std::to_string(campaign.seed)},
          {"num_runs", campaign.num_runs},
          {"note", campaign.note()},
          {"num_steps", plan.num_steps()},
          {"step_name", campaign.model().step_name()},
          {"one_core_s", cost.one_core_s},
          {"all_cores_s", cost.all_cores_s},
          {"num_cores", wire::num_processors()},
          {"disk_bytes", cost.disk_mb * 1e6},
          {"num_drawn", outlook.num_drawn},
          {"num_draws", outlook.num_draws},
          {"num_without_draw", outlook.num_without_draw},
          {"num_simulated", outlook.num_simulated},
          {"num_without_estimate", outlook.missing.total()},
          {"differences", array_of(outlook.differences, of_difference)}};
}

std::string check_text(const CheckOptions& options, const Campaign& campaign, const Plan& plan,
                       const Outlook& outlook, const CostEstimate& cost) {
  // The steps of a model program are its own.
  const std::string steps = plan.num_steps() == 1 ? std::string()
                                                  : fmt::format(" of {} {}", plan.num_steps(),
                                                                campaign.model().step_name());
  return fmt::format("{} is valid\nCampaign  {}, seed {}\nRuns      {}{}\n{}{}\n{}\n{}",
                     options.file.string(), campaign.name, campaign.seed, campaign.num_runs, steps,
                     note_text(campaign.note()), outlook_text(options, campaign, outlook),
                     cost_text(cost), differences_text(outlook.differences));
}

int check_campaign_file(const CheckOptions& options) {
  const std::unique_ptr<const Campaign> campaign = read_campaign(options.file, options.overrides);
  const std::unique_ptr<const Plan> plan = campaign->prepare();
  const Outlook outlook = outlook_on(*campaign, *plan);
  const CostEstimate cost = estimated_cost(*campaign, campaign->num_runs, outlook.batch_s);
  if (options.format == OutputFormat::json) {
    print_json(check_json(options, *campaign, *plan, outlook, cost));
  } else {
    print_lines(fitted(check_text(options, *campaign, *plan, outlook, cost)));
  }
  return exit_done;
}

}  // namespace

void add_check(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<CheckOptions>(
      app, chosen, "check", "Check a campaign file; show its cost and changes",
      check_campaign_file);
  add_campaign_file(command, options.file);
  add_override_options(command, options.overrides);
  add_json_flag(command, options.format);
}

namespace {

/// Processor time after which the time of a batch is extrapolated.
constexpr double measured_s_max = 0.5;

/// Thrown out of a simulation that has been measured for long enough.
struct Measured {};

/// Size of a campaign database. An empty database has 170 kB; a run adds 8 bytes for each of its
/// numbers and 90 bytes for how and by whom it was computed. Measured with 25 numbers a run.
double database_mb(const ResultSchema& schema, std::uint64_t num_runs) {
  constexpr double empty_size = 170e3, number_size = 8.0, further_size = 90.0;
  // Truth and estimate of each quantity; where each session has a fit, each estimate has an error.
  const auto num_numbers = static_cast<double>(2 * schema.quantities.size() + schema.health.size() +
                                               2 * schema.fit_parts.size());
  const double run_size = number_size * num_numbers + further_size;
  return (empty_size + run_size * static_cast<double>(num_runs)) / 1e6;
}

std::vector<RunRequest> first_requests(const Campaign& campaign, std::size_t count) {
  std::vector<RunRequest> requests;
  for (std::uint64_t run = 0; run < std::min<std::uint64_t>(count, campaign.num_runs); ++run) {
    requests.push_back({.run = {run}, .table_values = campaign.table_values({run})});
  }
  return requests;
}

/// Of a program beside this one, the time that passes: one run, and a batch if that is short. The
/// first run of a process may compile and load; if it is long, the time is that of another one.
FirstBatch try_program(const Campaign& campaign, const Plan& plan) {
  using Clock = std::chrono::steady_clock;
  const InstructionSet set = best_instruction_set();
  (void)plan.simulate_batch({}, set);  // Starts it.
  FirstBatch batch;
  double elapsed_s = 0.0;
  for (const bool is_first : {true, false}) {
    const bool is_single = is_first || elapsed_s > measured_s_max;
    const std::vector<RunRequest> requests =
        first_requests(campaign, is_single ? 1 : campaign.model().batch_size());
    const Clock::time_point start = Clock::now();
    batch.results = plan.simulate_batch(requests, set);
    elapsed_s = std::chrono::duration<double>(Clock::now() - start).count();
    batch.time_s = elapsed_s * static_cast<double>(campaign.model().batch_size()) /
                   static_cast<double>(requests.size());
  }
  return batch;
}

}  // namespace

FirstBatch try_first_batch(const Campaign& campaign, const Plan& plan) {
  if (!campaign.model().description().empty()) return try_program(campaign, plan);
  const InstructionSet set = best_instruction_set();
  // Scalar code simulates the runs of a batch one after the other.
  const std::size_t num_at_once = set == InstructionSet::scalar ? 1 : campaign.model().batch_size();
  const std::vector<RunRequest> requests = first_requests(campaign, num_at_once);
  const std::clock_t start = std::clock();
  const auto elapsed_s = [start] {
    return static_cast<double>(std::clock() - start) / static_cast<double>(CLOCKS_PER_SEC);
  };
  int num_steps = plan.num_steps();
  std::vector<RunResult> results;
  try {
    results = plan.simulate_batch(requests, set, [&](int num_steps_now) {
      if (num_steps_now == 0 || elapsed_s() < measured_s_max) return;
      num_steps = num_steps_now;
      throw Measured{};
    });
  } catch (const Measured&) {
    // The steps so far are enough.
  }
  const double all_steps = static_cast<double>(plan.num_steps()) / num_steps;
  const std::size_t num_rounds = campaign.model().batch_size() / num_at_once;
  return {.time_s = elapsed_s() * all_steps * static_cast<double>(num_rounds),
          .results = std::move(results)};
}

CostEstimate& CostEstimate::operator+=(const CostEstimate& other) {
  one_core_s += other.one_core_s;
  all_cores_s += other.all_cores_s;
  disk_mb += other.disk_mb;
  return *this;
}

CostEstimate estimated_cost(const Campaign& campaign, std::uint64_t num_runs, double batch_s) {
  const auto time_s = [&](std::uint64_t num_at_a_time) {
    return static_cast<double>((num_runs + num_at_a_time - 1) / num_at_a_time) * batch_s;
  };
  const std::size_t batch_size = campaign.model().batch_size();
  return {.one_core_s = time_s(batch_size),
          .all_cores_s = time_s(batch_size * wire::num_processors()),
          .disk_mb = database_mb(campaign.results(), num_runs)};
}

std::string cost_text(const CostEstimate& cost) {
  return fmt::format(
      "Time      about {} of one core; {} on the {} cores here\n"
      "Disk      about {:.1f} MB\n",
      duration_text(cost.one_core_s), duration_text(cost.all_cores_s), wire::num_processors(),
      cost.disk_mb);
}

}  // namespace proofmass::coordinator
