#include "proto/model_program/program_model.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>
#include <vector>

#include "core/campaign/expression.hpp"
#include "core/campaign/law_keys.hpp"
#include "core/campaign/recording.hpp"
#include "core/campaign/simulation_crash.hpp"
#include "core/definition/definition_text.hpp"
#include "core/definition/document.hpp"
#include "core/math/hash.hpp"
#include "core/random/stream.hpp"
#include "proto/model_program/program_description.hpp"
#include "proto/model_program/program_process.hpp"

namespace proofmass::wire {
namespace {

using Json = nlohmann::json;

/// What all campaigns of a model program share.
struct Program {
  std::filesystem::path path;
  ProgramDescription description;
  std::vector<DrawnQuantity> drawn;
};

/// With an answer of its own where something is wrong with the parameters.
void expect_accepted(std::string_view answer, const Program& program) {
  const Json json = Json::parse(answer, nullptr, false);
  if (json.is_object() && json.contains("refused") && json["refused"].is_string() &&
      json.contains("rule") && json["rule"].is_string()) {
    const std::string name = json["refused"];
    const double value = json.value("value", 0.0);
    throw ConfigError("parameters." + name, detail::number_text(value),
                      json["rule"].get<std::string>());
  }
  if (json.is_object() && json.empty()) return;
  throw ModelProgramError(
      fmt::format("model program = {} (must answer prepare with {{}} or what it refuses)",
                  program.path.string()));
}

class ProgramCampaign final : public Campaign {
 public:
  explicit ProgramCampaign(std::shared_ptr<const Program> of) : program(std::move(of)) {
    name = program->description.version.substr(0, program->description.version.rfind('-'));
    for (const ProgramParameter& parameter : program->description.parameters) {
      parameters.push_back(parameter.value);
    }
    for (const ProgramDraw& draw : program->description.drawn) laws.push_back(draw.law);
    for (const ProgramQuantity& quantity : program->description.quantities) {
      objectives_.push_back(quantity.objective);
    }
  }

  std::shared_ptr<const Program> program;
  std::vector<double> parameters;  ///< Of each of the program's.
  std::vector<Dispersion> laws;    ///< Of each drawn quantity.

  void read(Document& document);
  void validate() const override;
  [[nodiscard]] std::unique_ptr<Campaign> clone() const override {
    return std::make_unique<ProgramCampaign>(*this);
  }
  [[nodiscard]] std::unique_ptr<const Plan> prepare() const override;
  [[nodiscard]] Definition definition(TableColumns) const override { return {.text = text()}; }
  [[nodiscard]] std::vector<DefinitionItem> items() const override;
  [[nodiscard]] std::vector<DefinitionDifference> differences_from(
      const Campaign& other) const override;
  [[nodiscard]] ResultSchema results() const override;
  [[nodiscard]] std::vector<double> objectives() const override { return objectives_; }
  [[nodiscard]] std::int64_t num_rounds_max() const override { return 1; }
  [[nodiscard]] std::vector<std::size_t> table_quantities() const override { return {}; }
  [[nodiscard]] RunDraw draw(RunIndex run) const override;

  /// All of the campaign as TOML, in the one form that Model::campaign_of() takes.
  [[nodiscard]] std::string text() const;
  [[nodiscard]] std::string question_of_preparation() const;

 private:
  std::vector<double> objectives_;
};

std::string value_text(const DefinitionValue& value) {
  if (const auto* const whole = std::get_if<std::int64_t>(&value)) return fmt::to_string(*whole);
  if (const auto* const number = std::get_if<double>(&value)) return detail::number_text(*number);
  return detail::quoted_text(std::get<std::string>(value));
}

std::string_view name_of(Law law) { return names_of(law)[static_cast<std::size_t>(law) - 1]; }

std::vector<DefinitionItem> ProgramCampaign::items() const {
  const ProgramDescription& of = program->description;
  std::vector<DefinitionItem> items{{"campaign.name", name},
                                    {"campaign.seed", static_cast<std::int64_t>(seed)},
                                    {"campaign.runs", static_cast<std::int64_t>(num_runs)}};
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    items.push_back({"parameters." + of.parameters[i].name, parameters[i]});
  }
  for (std::size_t i = 0; i < laws.size(); ++i) {
    const std::string path = "drawn." + of.drawn[i].name;
    Dispersion law = laws[i];
    items.push_back({path + ".law", std::string(name_of(law.law))});
    for (const std::string_view key : keys_of(law.law)) {
      items.push_back({fmt::format("{}.{}", path, key), *number_at(law, key)});
    }
  }
  for (std::size_t i = 0; i < objectives_.size(); ++i) {
    if (std::isfinite(objectives_[i])) {
      items.push_back({"objectives." + of.quantities[i].name, objectives_[i]});
    }
  }
  return items;
}

std::string ProgramCampaign::text() const {
  std::string text, table;
  for (const DefinitionItem& item : items()) {
    const std::size_t dot = item.key.rfind('.');
    const std::string of = item.key.substr(0, dot);
    if (std::exchange(table, of) != of) {
      text += fmt::format("{}[{}]\n", text.empty() ? "" : "\n", of);
    }
    text += fmt::format("{} = {}\n", item.key.substr(dot + 1), value_text(item.value));
  }
  return text;
}

std::vector<DefinitionDifference> ProgramCampaign::differences_from(const Campaign& other) const {
  // Laws may have different keys: a key that one campaign lacks is a difference, too.
  std::vector<DefinitionItem> others = other.items();
  std::vector<DefinitionDifference> differences;
  const auto differ = [&](const std::string& key, std::string first, std::string second) {
    if (key == "campaign.runs" || first == second) return;
    const std::string_view prefix = "campaign.";
    differences.push_back({key.starts_with(prefix) ? key.substr(prefix.size()) : key,
                           std::move(first), std::move(second)});
  };
  for (const DefinitionItem& item : items()) {
    const auto same = std::ranges::find(others, item.key, &DefinitionItem::key);
    differ(item.key, value_text(item.value),
           same == others.end() ? "none" : value_text(same->value));
    if (same != others.end()) others.erase(same);
  }
  for (const DefinitionItem& item : others) differ(item.key, "none", value_text(item.value));
  return differences;
}

void read_law(Document& document, const std::string& path, Dispersion& law) {
  const Law before = law.law;
  if (document.read(path + ".law", law.law)) {
    if (!is_law_of_programs(law.law)) {
      document.refuse(path + ".law", laws_of_programs_rule);
      law.law = before;
    }
    if (law.law != before) {
      Dispersion other;
      other.law = law.law;
      law = other;
    }
  }
  for (const std::string_view key : keys_of(law.law)) {
    const std::string key_path = fmt::format("{}.{}", path, key);
    if (!document.read(key_path, *number_at(law, key)) && law.law != before) {
      document.refuse_absence(key_path, fmt::format("the law {} needs it", name_of(law.law)));
    }
  }
}

void ProgramCampaign::read(Document& document) {
  const ProgramDescription& of = program->description;
  auto whole_seed = static_cast<std::int64_t>(seed);
  auto whole_runs = static_cast<std::int64_t>(num_runs);
  document.read("campaign.name", name);
  document.read("campaign.seed", whole_seed, range::not_negative);
  document.read("campaign.runs", whole_runs, range::between(1, double{num_runs_max}));
  seed = static_cast<std::uint64_t>(whole_seed);
  num_runs = static_cast<std::uint64_t>(whole_runs);
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    document.read("parameters." + of.parameters[i].name, parameters[i]);
  }
  for (std::size_t i = 0; i < laws.size(); ++i) {
    read_law(document, "drawn." + of.drawn[i].name, laws[i]);
  }
  for (std::size_t i = 0; i < objectives_.size(); ++i) {
    document.read("objectives." + of.quantities[i].name, objectives_[i], range::positive);
  }
  document.check();
  try {
    validate();
  } catch (const ConfigError& error) {
    throw document.located(error);
  }
}

void ProgramCampaign::validate() const {
  check_identity(*this);
  check_table_columns(*this, {});
  for (std::size_t i = 0; i < laws.size(); ++i) {
    laws[i].validate("drawn." + program->description.drawn[i].name);
  }
}

RunDraw ProgramCampaign::draw(RunIndex run) const {
  const ProgramDescription& of = program->description;
  RunDraw draw{.num_draws = 1};
  for (std::size_t i = 0; i < laws.size(); ++i) {
    draw.values.push_back(draw_value(laws[i], of.drawn[i].name, seed, run, 0, 0.0));
  }
  for (const ProgramQuantity& quantity : of.quantities) {
    draw.truth.push_back(evaluate_expression(quantity.truth, [&](std::string_view input) {
      for (std::size_t i = 0; i < parameters.size(); ++i) {
        if (of.parameters[i].name == input) return parameters[i];
      }
      return draw.values[static_cast<std::size_t>(
          std::ranges::find(of.drawn, input, &ProgramDraw::name) - of.drawn.begin())];
    }));
  }
  if (!std::ranges::all_of(draw.truth, is_in_range)) return {.num_draws = 1};
  return draw;
}

ResultSchema ProgramCampaign::results() const {
  ResultSchema schema;
  for (const ProgramQuantity& quantity : program->description.quantities) {
    schema.quantities.push_back({.name = quantity.name,
                                 .unit_suffix = "",
                                 .symbol = quantity.symbol,
                                 .unit = quantity.unit,
                                 .display_scale = quantity.display_scale,
                                 .display_unit = quantity.display_unit,
                                 .objective = quantity.objective,
                                 .has_standard_error = quantity.has_standard_error});
  }
  schema.loss_causes = {"program"};
  schema.loss_sessions = {"run"};
  return schema;
}

std::string ProgramCampaign::question_of_preparation() const {
  Json question{{"ask", "prepare"}, {"parameters", Json::object()}};
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    question["parameters"][program->description.parameters[i].name] = parameters[i];
  }
  return question.dump();
}

/// Processes of a program that have been told the parameters, each for one thread at a time.
class ProgramPlan final : public Plan {
 public:
  explicit ProgramPlan(const ProgramCampaign& campaign) : campaign_(campaign) {}

  [[nodiscard]] std::vector<RunResult> simulate_batch(
      std::span<const RunRequest> requests, InstructionSet,
      const std::function<void(int)>& progress) const override;
  [[nodiscard]] RunResult replay(const RunRequest& request, const SampleSink& /*sink*/,
                                 const std::function<void(int)>& progress) const override {
    return simulate_batch({&request, 1}, InstructionSet::scalar, progress).front();
  }
  [[nodiscard]] const Recording& recording() const override { return recording_; }
  [[nodiscard]] int num_steps() const override { return 1; }

 private:
  [[nodiscard]] std::unique_ptr<ProgramProcess> take_process() const;
  [[nodiscard]] std::string question_of(RunIndex run, const RunDraw& draw) const;
  [[nodiscard]] RunResult result_in(std::string_view answer, RunIndex run, RunDraw draw) const;

  const ProgramCampaign campaign_;
  const Recording recording_;
  mutable std::mutex mutex_;
  mutable std::vector<std::unique_ptr<ProgramProcess>> idle_;
};

std::unique_ptr<ProgramProcess> ProgramPlan::take_process() const {
  {
    const std::lock_guard lock(mutex_);
    if (!idle_.empty()) {
      std::unique_ptr<ProgramProcess> process = std::move(idle_.back());
      idle_.pop_back();
      return process;
    }
  }
  const Program& program = *campaign_.program;
  auto process = std::make_unique<ProgramProcess>(program.path, program.description.limits);
  const std::string question = campaign_.question_of_preparation();
  process->ask({&question, 1}, [&](std::string_view answer) { expect_accepted(answer, program); });
  return process;
}

std::string ProgramPlan::question_of(RunIndex run, const RunDraw& draw) const {
  const ProgramDescription& of = campaign_.program->description;
  Json question{{"ask", "run"}, {"run", run.value}};
  for (std::size_t i = 0; i < of.drawn.size(); ++i) {
    question["drawn"][of.drawn[i].name] = draw.values[i];
  }
  for (const std::string& stream : of.streams) {
    const RandomBlock seed = RandomStream(campaign_.seed, run, stream_id(stream)).block(0);
    question["seeds"][stream] =
        fmt::format("{:08x}{:08x}{:08x}{:08x}", seed[0], seed[1], seed[2], seed[3]);
  }
  return question.dump();
}

/// @return One number for each name, or nothing if one is null: it is not finite.
std::optional<std::vector<double>> numbers_in(const Json& object,
                                              const std::vector<std::string_view>& names,
                                              const std::function<void(std::string_view)>& refuse) {
  if (!object.is_object() || object.size() != names.size()) {
    refuse(fmt::format("must have a number for each of {} quantities", names.size()));
  }
  std::vector<double> numbers;
  for (const std::string_view name : names) {
    const auto found = object.find(name);
    if (found == object.end() || !(found->is_number() || found->is_null())) {
      refuse(fmt::format("must have a number for {}", name));
    }
    if (found->is_null() || !is_in_range(found->get<double>())) return std::nullopt;
    numbers.push_back(*found);
  }
  return numbers;
}

RunResult ProgramPlan::result_in(std::string_view answer, RunIndex run, RunDraw draw) const {
  const auto refuse_as = [&](std::string_view what) {
    return [this, run, what](std::string_view rule) {
      throw ModelProgramError(fmt::format("model program = {} (run {}: {} {})",
                                          campaign_.program->path.string(), run.value, what, rule));
    };
  };
  const Json json = Json::parse(answer, nullptr, false);
  if (!json.is_object()) refuse_as("the answer")("must be an object of JSON");
  RunResult result{.run = run, .num_draws = draw.num_draws, .truth = std::move(draw.truth)};
  if (json.contains("lost")) {
    if (json["lost"] != true) refuse_as("lost")("must be true, or left out");
    result.status = RunStatus::lost;
    result.loss = {.cause = 1, .session = 1};
    return result;
  }
  std::vector<std::string_view> names, with_errors;
  for (const ProgramQuantity& quantity : campaign_.program->description.quantities) {
    names.push_back(quantity.name);
    if (quantity.has_standard_error) with_errors.push_back(quantity.name);
  }
  const auto estimate = numbers_in(json.value("estimate", Json()), names, refuse_as("estimate"));
  auto errors = with_errors.empty() ? std::optional<std::vector<double>>(std::in_place)
                                    : numbers_in(json.value("standard_error", Json()), with_errors,
                                                 refuse_as("standard_error"));
  if (!estimate || !errors || std::ranges::any_of(*errors, [](double e) { return e < 0.0; })) {
    result.status = RunStatus::not_finite;
    return result;
  }
  result.num_rounds = 1;
  result.estimate = *estimate;
  result.standard_error = *std::move(errors);
  // Standard errors are taken as those of independent estimates.
  const std::size_t num_errors = result.standard_error.size();
  if (num_errors > 0) result.correlations.assign(num_errors * (num_errors - 1) / 2, 0.0);
  return result;
}

std::vector<RunResult> ProgramPlan::simulate_batch(std::span<const RunRequest> requests,
                                                   InstructionSet,
                                                   const std::function<void(int)>& progress) const {
  std::vector<RunResult> results(requests.size());
  std::vector<RunDraw> draws;
  std::vector<std::size_t> asked;  // All but those whose truth is out of range.
  std::vector<std::string> questions;
  for (std::size_t i = 0; i < requests.size(); ++i) {
    RunDraw draw = campaign_.draw(requests[i].run);
    if (draw.truth.empty()) {
      results[i] = {.run = requests[i].run, .status = RunStatus::no_draw, .num_draws = 1};
      continue;
    }
    questions.push_back(question_of(requests[i].run, draw));
    draws.push_back(std::move(draw));
    asked.push_back(i);
  }
  std::unique_ptr<ProgramProcess> process;
  std::size_t num_answered = 0;
  try {
    process = take_process();
    process->ask(questions, [&](std::string_view answer) {
      const std::size_t i = asked[num_answered];
      results[i] = result_in(answer, requests[i].run, std::move(draws[num_answered]));
      ++num_answered;
      if (progress) progress(0);
    });
  } catch (const ModelProgramError& error) {
    throw SimulationCrash(error.what());
  }
  if (progress) progress(num_steps());
  const std::lock_guard lock(mutex_);
  idle_.push_back(std::move(process));
  return results;
}

std::unique_ptr<const Plan> ProgramCampaign::prepare() const {
  return std::make_unique<const ProgramPlan>(*this);
}

class ProgramModel final : public Model {
 public:
  explicit ProgramModel(std::shared_ptr<const Program> program) : program_(std::move(program)) {}

  [[nodiscard]] std::string_view version() const override { return program_->description.version; }
  [[nodiscard]] std::string_view purpose() const override { return program_->description.purpose; }
  [[nodiscard]] ResultSchema results_of(std::string_view, std::string_view) const override {
    return ProgramCampaign(program_).results();
  }
  [[nodiscard]] std::span<const DataTableSchema> tables() const override { return {}; }
  [[nodiscard]] std::span<const DrawnQuantity> drawn() const override { return program_->drawn; }
  [[nodiscard]] std::string_view step_name() const override { return "steps"; }
  [[nodiscard]] std::size_t batch_size() const override {
    return program_->description.runs_at_once;
  }

  [[nodiscard]] std::uint64_t reference_digest(InstructionSet set) const override {
    constexpr std::uint64_t num_runs = 3;
    std::uint64_t digest = fnv1a_basis;
    const std::unique_ptr<const Plan> plan = ProgramCampaign(program_).prepare();
    for (std::uint64_t run = 0; run < num_runs; ++run) {
      const RunRequest request{RunIndex{run}, {}};
      const std::vector<RunResult> results = plan->simulate_batch({&request, 1}, set, {});
      for (const double value : results.front().estimate) {
        digest = fnv1a(digest, std::bit_cast<std::uint64_t>(value));
      }
    }
    return digest;
  }

  [[nodiscard]] std::unique_ptr<Campaign> campaign_of(Definition definition, TableColumns,
                                                      std::string_view source) const override {
    Document document(std::string(source), definition.text, {});
    auto campaign = std::make_unique<ProgramCampaign>(program_);
    campaign->read(document);
    if (campaign->definition(TableColumns::included) == definition) return campaign;
    throw DefinitionError(fmt::format("{}: is no definition of {}", source, version()));
  }

  /// The program itself has a say, which it has where it runs in all other cases.
  [[nodiscard]] std::unique_ptr<Campaign> read_campaign(Document& document,
                                                        DataFiles&) const override {
    auto campaign = std::make_unique<ProgramCampaign>(program_);
    campaign->read(document);
    ProgramProcess process(program_->path, program_->description.limits);
    const std::string question = campaign->question_of_preparation();
    try {
      process.ask({&question, 1},
                  [&](std::string_view answer) { expect_accepted(answer, *program_); });
    } catch (const ConfigError& error) {
      throw document.located(error);
    }
    return campaign;
  }

  [[nodiscard]] std::string example() const override { return ProgramCampaign(program_).text(); }
  [[nodiscard]] std::string_view example_file() const override { return example_file_; }

 private:
  std::shared_ptr<const Program> program_;
  std::string example_file_ = ProgramCampaign(program_).name + ".toml";
};

}  // namespace

std::unique_ptr<const Model> model_of(const std::filesystem::path& path) {
  constexpr ProgramLimits while_describing{.answer_time_max = std::chrono::seconds(60)};
  auto program = std::make_shared<Program>();
  program->path = std::filesystem::absolute(path);
  ProgramProcess process(program->path, while_describing);
  const std::string question = Json{{"ask", "describe"}}.dump();
  process.ask({&question, 1},
              [&](std::string_view answer) { program->description = description_in(answer); });
  for (const ProgramDraw& draw : program->description.drawn) {
    program->drawn.push_back({draw.name, draw.unit});
  }
  return std::make_unique<ProgramModel>(std::move(program));
}

}  // namespace proofmass::wire
