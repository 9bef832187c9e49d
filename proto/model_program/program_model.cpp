#include "proto/model_program/program_model.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <limits>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "core/campaign/recording.hpp"
#include "core/definition/definition_text.hpp"
#include "core/error.hpp"
#include "core/random/stream.hpp"
#include "proto/link/machine.hpp"
#include "proto/model_program/described_model.hpp"
#include "proto/model_program/json_line.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::wire {
namespace {

/// Two connected sockets, which are closed in programs that are started, but for what they are
/// given.
std::pair<Descriptor, Descriptor> connected_pair() {
  std::array<int, 2> ends{};
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) == 0) {
    return {Descriptor(ends[0]), Descriptor(ends[1])};
  }
  throw ModelProgramError(
      fmt::format("model program: no socket: {}", std::generic_category().message(errno)));
}

/// A pipe: its first end is told what the second one writes, and when that is closed.
std::pair<Descriptor, Descriptor> new_pipe() {
  std::array<int, 2> ends{};
  if (pipe2(ends.data(), O_CLOEXEC) == 0) return {Descriptor(ends[0]), Descriptor(ends[1])};
  throw ModelProgramError(
      fmt::format("model program: no pipe: {}", std::generic_category().message(errno)));
}

/// Has the kernel kill the group of processes as soon as nobody has the other end of the pipe: it
/// then signals that there is something to read. A parent-death signal (PR_SET_PDEATHSIG) would
/// come when the thread that started the program ends, and other threads go on using it.
void kill_at_end_of(int pipe, pid_t group) {
  fcntl(pipe, F_SETSIG, SIGKILL);
  fcntl(pipe, F_SETOWN, -group);
  fcntl(pipe, F_SETFL, O_ASYNC);
}

constexpr std::size_t first_errors_size_max = 65536;
constexpr std::size_t last_errors_size_max = 4096;

}  // namespace

void ErrorOutput::take(std::string_view text) {
  const std::size_t shown =
      std::min(text.size(), first_errors_size_max - std::min(first_errors_size_max, size_));
  say_on(stderr, text.substr(0, shown));
  size_ += text.size();
  last_ += text.substr(shown);
  if (last_.size() > last_errors_size_max) last_.erase(0, last_.size() - last_errors_size_max);
}

void ErrorOutput::end(std::string_view program) {
  const std::size_t shown = first_errors_size_max + last_.size();
  if (size_ > shown) {
    say(fmt::format("\n{}: {} bytes of its standard error are left out here\n", program,
                    size_ - shown));
  }
  say_on(stderr, last_);
}

ProgramProcess::ProgramProcess(const std::filesystem::path& program, const ProgramLimits& limits)
    : name_(program.string()) {
  auto [questions, its_input] = connected_pair();
  auto [answers, its_output] = connected_pair();
  auto [errors, its_errors] = new_pipe();
  auto [its_lifeline, lifeline] = new_pipe();
  try {
    process_id_ = start_program({.arguments = {name_},
                                 .descriptors = {its_input.number(), its_output.number(),
                                                 its_errors.number(), its_lifeline.number()},
                                 .environment = environment_without_settings(),
                                 .has_own_group = true});
  } catch (const Error& error) {
    const std::string_view what = error.what();
    const bool is_no_program = what.ends_with(std::generic_category().message(ENOEXEC));
    throw ModelProgramError(
        fmt::format("model program = {}{}", what,
                    is_no_program ? "; a script begins with #! and what runs it" : ""));
  }
  kill_at_end_of(its_lifeline.number(), process_id_);
  questions_ = std::move(questions);
  answers_ = std::move(answers);
  errors_ = std::move(errors);
  lifeline_ = std::move(lifeline);
  fcntl(errors_.number(), F_SETFL, O_NONBLOCK);
  limit(limits);
}

void ProgramProcess::limit(const ProgramLimits& limits) {
  answer_time_max_ = std::chrono::seconds(limits.answer_time_max_s);
  rlimit memory{};
  prlimit(process_id_, RLIMIT_DATA, nullptr, &memory);
  // The hard one stays: nobody could raise it again.
  memory.rlim_cur = std::min(memory.rlim_max, rlim_t{limits.memory_max_mib} << 20);
  prlimit(process_id_, RLIMIT_DATA, &memory, nullptr);
}

ProgramProcess::~ProgramProcess() {
  if (process_id_ != 0) {
    kill(process_id_, SIGKILL);
    (void)wait_for_end(process_id_);
  }
  pass_on_errors();
  error_output_.end(name_);
}

std::string ProgramProcess::how_it_ended() {
  // It has closed its output, which it does just before it ends unless it means to stay.
  constexpr int attempts_max = 100;
  for (int i = 0; i < attempts_max; ++i) {
    if (const std::optional<int> status = status_if_ended(process_id_)) {
      process_id_ = 0;
      return end_text(*status);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return "it closed its output";
}

void ProgramProcess::fail(std::string_view reason) const {
  throw ModelProgramError(fmt::format("model program = {} ({})", name_, reason));
}

void ProgramProcess::fail_unasked(std::string_view text) const {
  fail("answers what it was not asked: " + excerpt_of(text.substr(0, text.find('\n'))));
}

void ProgramProcess::write_some(std::string_view& text) const {
  const ssize_t size =
      send(questions_.number(), text.data(), text.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
  if (size >= 0) {
    text.remove_prefix(static_cast<std::size_t>(size));
  } else if (errno != EAGAIN && errno != EINTR) {
    text = {};  // It has closed its input; that it has ended is seen where it should answer.
  }
}

void ProgramProcess::expect_silence() const {
  std::array<char, 81> part;  // NOLINT: recv() fills it.
  const ssize_t size = recv(answers_.number(), part.data(), part.size(), MSG_DONTWAIT | MSG_PEEK);
  if (size > 0) fail_unasked({part.data(), static_cast<std::size_t>(size)});
}

void ProgramProcess::read_some() {
  std::array<char, 65536> part;  // NOLINT: recv() fills it.
  const ssize_t size = recv(answers_.number(), part.data(), part.size(), MSG_DONTWAIT);
  if (size > 0) {
    received_.append(part.data(), static_cast<std::size_t>(size));
  } else if (size == 0 || (errno != EAGAIN && errno != EINTR)) {
    fail(fmt::format("gave no answer: {}", how_it_ended()));
  }
}

void ProgramProcess::pass_on_errors() {
  std::array<char, 65536> part;  // NOLINT: read() fills it.
  // No more than once what a pipe holds: a program may print without an end.
  const ssize_t size = read(errors_.number(), part.data(), part.size());
  if (size > 0) error_output_.take({part.data(), static_cast<std::size_t>(size)});
  if (size == 0) errors_ = Descriptor();  // It has closed it.
}

void ProgramProcess::ask(const std::vector<std::string>& questions,
                         const std::function<void(std::string_view answer)>& on_answer,
                         std::function<void()> on_silence) {
  using Clock = std::chrono::steady_clock;
  expect_silence();
  std::string all;
  for (const std::string& question : questions) all += question + '\n';
  std::string_view unsent = all;
  std::size_t num_answered = 0;
  Clock::time_point asked_at = Clock::now();
  while (num_answered < questions.size()) {
    std::array<pollfd, 3> ends{{{answers_.number(), POLLIN, 0},
                                {errors_.number(), POLLIN, 0},
                                {questions_.number(), POLLOUT, 0}}};
    const Clock::duration waited = Clock::now() - asked_at, most = answer_time_max_;
    if (waited >= most) {
      fail(fmt::format("no answer within {} s{}", answer_time_max_.count(),
                       has_answered_ ? "" : "; it must flush each answer"));
    }
    if (on_silence && waited >= most / 12) std::exchange(on_silence, nullptr)();
    const auto left =
        std::chrono::ceil<std::chrono::milliseconds>((on_silence ? most / 12 : most) - waited);
    poll(ends.data(), unsent.empty() ? 2 : 3, static_cast<int>(left.count()));
    if (ends[2].revents != 0) write_some(unsent);
    if (ends[1].revents != 0) pass_on_errors();
    if (ends[0].revents != 0) read_some();
    std::size_t begin = 0;
    for (std::size_t end = 0; (end = received_.find('\n', begin)) != std::string::npos;) {
      if (num_answered == questions.size()) break;
      on_answer(std::string_view(received_).substr(begin, end - begin));
      begin = end + 1;
      ++num_answered;
      has_answered_ = true;
      asked_at = Clock::now();
    }
    received_.erase(0, begin);
    if (received_.size() > answer_size_max) {
      fail(fmt::format("answers with a line of more than {} bytes", answer_size_max));
    }
  }
  if (!received_.empty()) fail_unasked(received_);
}

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

/// The file may have been replaced since the model was loaded, and then other runs would be
/// computed.
/// @throws ModelProgramError
void expect_same(std::string_view answer, const ProgramDescription& loaded,
                 const std::filesystem::path& program) {
  const ProgramDescription now = description_in(answer, program.string() + ": description");
  if (now.text == loaded.text) return;
  throw ModelProgramError(fmt::format(
      "model program = {} (describes {} now, and not {} as when it was loaded: start what "
      "runs it anew)",
      program.string(), now.version, loaded.version));
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
  ProgramPlan(std::filesystem::path program, const DescribedCampaign& campaign)
      : program_(std::move(program)), campaign_(campaign) {}
  ~ProgramPlan() override {
    if (has_computed_ || idle_.empty()) return;
    FreshProcesses::instance().keep(
        program_, {.process = std::move(idle_.back()), .prepared = prepare_question(campaign_)});
  }
  ProgramPlan(const ProgramPlan&) = delete;
  ProgramPlan& operator=(const ProgramPlan&) = delete;

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
  return prepared_process(program_, campaign_);
}

std::string ProgramPlan::question_of(RunIndex run, const std::vector<double>& drawn) const {
  const ProgramDescription& of = campaign_.description();
  Json question{{"ask", "run"}, {"run", run.value}};
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
  FreshProcesses::instance().keep(program, {.process = std::move(process), .prepared = ""});
  return std::make_unique<DescribedModel>(
      std::move(description), std::nullopt, [program](const DescribedCampaign& campaign) {
        return std::make_unique<const ProgramPlan>(program, campaign);
      });
}

void end_fresh_programs() { FreshProcesses::instance().end(); }

}  // namespace proofmass::wire
