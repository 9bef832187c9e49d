#include "proto/model_program/program_model.hpp"

#include <fmt/format.h>

#include <chrono>
#include <limits>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/campaign/recording.hpp"
#include "core/definition/definition_text.hpp"
#include "core/error.hpp"
#include "core/random/stream.hpp"
#include "proto/model_program/described_model.hpp"
#include "proto/model_program/json_line.hpp"
#include "proto/model_program/program_process.hpp"

namespace proofmass::wire {
namespace {

using Json = nlohmann::json;

/// @throws ConfigError about the parameter that the program refuses, if it does.
void expect_accepted(std::string_view answer, const std::filesystem::path& program,
                     const DescribedCampaign& campaign) {
  Json json = Json::parse(answer, nullptr, false);
  if (json.is_object() && json.empty()) return;
  if (!json.is_object()) json = Json::object();
  const Json refused = json.value("refused", Json()), rule = json.value("rule", Json());
  for (std::size_t i = 0; i < campaign.parameters.size(); ++i) {
    const std::string& name = campaign.description().parameters[i].name;
    if (refused != name || !rule.is_string()) continue;
    throw ConfigError("parameters." + name, detail::number_text(campaign.parameters[i]),
                      rule.get<std::string>());
  }
  throw ModelProgramError(
      fmt::format("model program = {} (must answer prepare with {{}}, or with a parameter that it "
                  "refuses and the rule: {})",
                  program.string(), excerpt_of(answer)));
}

/// @throws ModelProgramChanged
void expect_same(std::string_view answer, const ProgramDescription& loaded,
                 const std::filesystem::path& program) {
  const ProgramDescription now = description_in(answer, program.string() + ": description");
  if (now.text == loaded.text) return;
  throw ModelProgramChanged(
      fmt::format("model program = {} (describes {} now, and not {} as when it was loaded: {})",
                  program.string(), now.version, loaded.version,
                  now.version == loaded.version ? "its answer to describe must always be the same"
                                                : "start what runs it anew"));
}

std::string describe_question() { return Json{{"ask", "describe"}}.dump(); }

std::string prepare_question(const DescribedCampaign& campaign) {
  Json question{{"ask", "prepare"}, {"parameters", Json::object()}};
  for (std::size_t i = 0; i < campaign.parameters.size(); ++i) {
    question["parameters"][campaign.description().parameters[i].name] = campaign.parameters[i];
  }
  return question.dump();
}

/// A process that has said what it is, and has computed nothing yet.
struct FreshProcess {
  std::unique_ptr<ProgramProcess> process;
  std::string prepared;  // By this question; empty: not yet.
};

/// One of each program, for whoever needs one next: some take long to start.
class FreshProcesses {
 public:
  static FreshProcesses& instance() {
    static FreshProcesses all;
    return all;
  }

  void keep(const std::filesystem::path& program, FreshProcess fresh) {
    const std::lock_guard lock(mutex_);
    processes_[program] = std::move(fresh);
  }
  /// Null if there is none.
  FreshProcess take(const std::filesystem::path& program) {
    const std::lock_guard lock(mutex_);
    return std::exchange(processes_[program], {});
  }
  void end() {
    const std::lock_guard lock(mutex_);
    processes_.clear();
  }

 private:
  std::mutex mutex_;
  std::map<std::filesystem::path, FreshProcess> processes_;
};

/// A process of the program that has accepted the parameters of a campaign. None is asked to accept
/// others after its first ones.
/// @throws ModelProgramError, or ModelProgramChanged if it describes itself otherwise.
std::unique_ptr<ProgramProcess> prepared_process(const std::filesystem::path& program,
                                                 const DescribedCampaign& campaign) {
  const ProgramDescription& of = campaign.description();
  const std::string question = prepare_question(campaign);
  FreshProcess fresh = FreshProcesses::instance().take(program);
  if (fresh.process && fresh.prepared == question) return std::move(fresh.process);
  if (!fresh.process || !fresh.prepared.empty()) {
    fresh.process = std::make_unique<ProgramProcess>(program, of.limits);
    fresh.process->ask({describe_question()},
                       [&](std::string_view answer) { expect_same(answer, of, program); });
  }
  fresh.process->limit(of.limits);
  fresh.process->ask({question},
                     [&](std::string_view answer) { expect_accepted(answer, program, campaign); });
  return std::move(fresh.process);
}

/// Processes of a program that have been told the parameters, each for one thread at a time.
class ProgramPlan final : public Plan {
 public:
  ProgramPlan(std::filesystem::path program, const DescribedCampaign& campaign,
              OnProcessStart on_start)
      : program_(std::move(program)), campaign_(campaign), on_start_(std::move(on_start)) {}
  ~ProgramPlan() override {
    if (has_computed_ || idle_.empty()) return;
    FreshProcesses::instance().keep(
        program_, {.process = std::move(idle_.back()), .prepared = prepare_question(campaign_)});
  }

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
  [[nodiscard]] std::string question_of(RunIndex run, const std::vector<double>& drawn) const;
  void read(std::string_view answer, RunResult& result) const;

  const std::filesystem::path program_;
  const DescribedCampaign campaign_;
  const OnProcessStart on_start_;
  const Recording recording_;
  mutable std::mutex mutex_;
  mutable std::vector<std::unique_ptr<ProgramProcess>> idle_;
  mutable bool has_computed_ = false;
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
  std::unique_ptr<ProgramProcess> process = prepared_process(program_, campaign_);
  if (on_start_) on_start_(std::chrono::steady_clock::now());
  return process;
}

std::string ProgramPlan::question_of(RunIndex run, const std::vector<double>& drawn) const {
  const ProgramDescription& of = campaign_.description();
  Json question{
      {"ask", "run"}, {"run", run.value}, {"drawn", Json::object()}, {"seeds", Json::object()}};
  for (std::size_t i = 0; i < of.drawn_names.size(); ++i) {
    question["drawn"][of.drawn_names[i]] = drawn[i];
  }
  for (const std::string& stream : of.streams) {
    const RandomBlock seed = RandomStream(campaign_.seed, run, stream_id(stream)).block(0);
    question["seeds"][stream] =
        fmt::format("{:08x}{:08x}{:08x}{:08x}", seed[0], seed[1], seed[2], seed[3]);
  }
  return question.dump();
}

/// @return A number for each name; NaN for null, which is not finite.
std::vector<double> numbers_in(const Json& object, const std::vector<std::string_view>& names,
                               const std::function<void(std::string_view)>& refuse) {
  if (!object.is_object() || object.size() > names.size()) {
    refuse(fmt::format("must have a number for each of {} declared ones and nothing else",
                       names.size()));
  }
  std::vector<double> numbers;
  for (const std::string_view name : names) {
    const Json number = object.value(name, Json("missing"));
    if (!number.is_number() && !number.is_null()) {
      refuse(fmt::format("must have a number for {}", name));
    }
    numbers.push_back(number.is_null() ? std::numeric_limits<double>::quiet_NaN()
                                       : number.get<double>());
  }
  return numbers;
}

void ProgramPlan::read(std::string_view answer, RunResult& result) const {
  const auto refuse_as = [&](std::string_view what) {
    return [this, answer, run = result.run.value, what](std::string_view rule) {
      throw ModelProgramError(fmt::format("model program = {} (run {}: {} {}: {})",
                                          program_.string(), run, what, rule, excerpt_of(answer)));
    };
  };
  Json json;
  try {
    json = object_in(answer);
  } catch (const InvalidArgument& error) {
    refuse_as("the answer")(error.what());
  }
  if (json.value("run", Json()) != result.run.value) {
    refuse_as("the answer")(fmt::format("must be of this run, with \"run\": {}", result.run.value));
  }
  if (json.contains("lost")) {
    if (json["lost"] != true) refuse_as("lost")("must be true, or left out");
    return set_lost(result);
  }
  std::vector<std::string_view> names, with_errors;
  for (const ProgramQuantity& quantity : campaign_.description().quantities) {
    names.push_back(quantity.name);
    if (quantity.has_standard_error) with_errors.push_back(quantity.name);
  }
  set_estimates(numbers_in(json.value("estimate", Json()), names, refuse_as("estimate")),
                numbers_in(json.value("standard_error", Json::object()), with_errors,
                           refuse_as("standard_error")),
                result);
}

std::vector<RunResult> ProgramPlan::simulate_batch(std::span<const RunRequest> requests,
                                                   InstructionSet,
                                                   const std::function<void(int)>& progress) const {
  std::vector<RunResult> results(requests.size());
  std::vector<RunResult*> asked;  // All but those whose truth is out of range.
  std::vector<std::string> questions;
  for (std::size_t i = 0; i < requests.size(); ++i) {
    const RunDraw draw = campaign_.drawn(requests[i].run, requests[i].table_values);
    results[i] = {.run = requests[i].run, .num_draws = draw.num_draws, .truth = draw.truth};
    if (draw.truth.empty()) {
      results[i].status = RunStatus::no_draw;
    } else {
      questions.push_back(question_of(requests[i].run, draw.values));
      asked.push_back(&results[i]);
    }
  }
  std::unique_ptr<ProgramProcess> process;
  try {
    process = take_process();
    process->ask(questions, [&, next = asked.begin()](std::string_view answer) mutable {
      read(answer, **next++);
      if (progress) progress(0);
    });
  } catch (const ModelProgramError& error) {
    throw SimulationCrash(error.what());
  }
  if (progress) progress(num_steps());
  const std::lock_guard lock(mutex_);
  idle_.push_back(std::move(process));
  if (!questions.empty()) has_computed_ = true;
  return results;
}

}  // namespace

std::unique_ptr<const Model> model_of(const std::filesystem::path& path,
                                      std::function<void()> on_silence) {
  constexpr ProgramLimits while_describing{.answer_time_max_s = 60};
  const std::filesystem::path program = std::filesystem::absolute(path);
  const std::string source = program.string() + ": description";
  ProgramDescription description;
  auto process = std::make_unique<ProgramProcess>(program, while_describing);
  process->ask(
      {describe_question()},
      [&](std::string_view answer) { description = description_in(answer, source); },
      std::move(on_silence));
  if (!description.imported_from.empty()) {
    throw DefinitionError(source + ": imported_from (must not be there: a program computes)");
  }
  // Databases hold descriptions from before this rule.
  for (const ProgramQuantity& quantity : description.quantities) {
    if (quantity.has_display_scale || quantity.display_unit == quantity.unit) continue;
    throw DefinitionError(
        fmt::format("{}: {}: display_unit = {} (needs display_scale, its size in units of {})",
                    source, quantity.name, quantity.display_unit, quantity.unit));
  }
  auto model = std::make_unique<DescribedModel>(
      std::move(description), std::nullopt,
      [program](const DescribedCampaign& campaign, OnProcessStart on_start) {
        return std::make_unique<const ProgramPlan>(program, campaign, std::move(on_start));
      });
  check_names(*model, source);
  FreshProcesses::instance().keep(program, {.process = std::move(process), .prepared = ""});
  return model;
}

void end_fresh_programs() { FreshProcesses::instance().end(); }

}  // namespace proofmass::wire
