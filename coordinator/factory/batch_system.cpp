#include <fmt/format.h>
#include <sys/mman.h>
#include <unistd.h>

#include <chrono>
#include <optional>
#include <sstream>

#include "coordinator/factory/factory.hpp"
#include "core/campaign/name.hpp"
#include "core/error.hpp"
#include "proto/link/machine.hpp"
#include "proto/link/whole_file.hpp"

namespace proofmass::coordinator {
namespace {

// Text.

std::vector<std::string> lines_of(std::string_view text) {
  std::vector<std::string> lines;
  std::istringstream stream{std::string(text)};
  for (std::string line; std::getline(stream, line);) {
    if (!line.empty()) lines.push_back(line);
  }
  return lines;
}

std::vector<std::string> words_of(const std::string& line) {
  std::istringstream stream(line);
  std::vector<std::string> words;
  for (std::string word; stream >> word;) words.push_back(word);
  return words;
}

/// `2:05:00`, as Slurm and PBS read it.
std::string clock_text(std::chrono::seconds duration) {
  const auto count = duration.count();
  return fmt::format("{}:{:02}:{:02}", count / 3600, count / 60 % 60, count % 60);
}

/// @throws Error unless it can be part of a worker's name.
std::string checked_id(std::string_view program, std::string id) {
  constexpr std::size_t size_max = 64;
  if (id.size() <= size_max && has_name_form(id)) return id;
  throw Error(fmt::format("{}: identifier = \"{}\" (must be 1 to {} of {})", program, id, size_max,
                          name_rule));
}

/// The script of an allocation whose identifier the batch system has in a variable.
std::string script(const FactoryConfig& config, std::string_view variable) {
  return fmt::format("#!/bin/bash\nset -- \"${}\"\n{}\n", variable, config.worker_command);
}

void append(std::vector<std::string>& arguments, const std::vector<std::string>& further) {
  arguments.insert(arguments.end(), further.begin(), further.end());
}

// Slurm.

BatchCommand slurm_submission(const FactoryConfig& config) {
  BatchCommand command{{"sbatch", "--parsable", "--job-name=" + config.queue_name, "--nodes=1",
                        "--ntasks=1", "--time=" + clock_text(config.walltime)},
                       script(config, "SLURM_JOB_ID")};
  command.arguments.push_back(config.num_processors
                                  ? fmt::format("--cpus-per-task={}", *config.num_processors)
                                  : std::string("--exclusive"));
  append(command.arguments, config.submit_options);
  return command;
}

BatchCommand slurm_listing(const FactoryConfig& config) {
  return {{"squeue", "--me", "--noheader", "--name=" + config.queue_name,
           "--states=PENDING,CONFIGURING,RUNNING,SUSPENDED", "--sort=i", "--format=%i %T"}};
}

// PBS: OpenPBS and PBS Pro.

BatchCommand pbs_submission(const FactoryConfig& config) {
  BatchCommand command{
      {"qsub", "-N", config.queue_name, "-l", "walltime=" + clock_text(config.walltime)},
      script(config, "PBS_JOBID")};
  append(command.arguments,
         config.num_processors ? std::vector<std::string>{"-l", fmt::format("select=1:ncpus={}",
                                                                            *config.num_processors)}
                               : std::vector<std::string>{"-l", "select=1", "-l", "place=excl"});
  append(command.arguments, config.submit_options);
  return command;
}

// qselect finds by name and state, and qstat cuts both; so it is asked twice.
BatchCommand pbs_listing(const FactoryConfig& config) {
  return {{"sh", "-c",
           "running=$(qselect -u \"$(id -un)\" -N \"$1\" -s R) || exit\n"
           "others=$(qselect -u \"$(id -un)\" -N \"$1\" -s HQSTUW) || exit\n"
           "for id in $others; do echo \"$id Q\"; done\n"
           "for id in $running; do echo \"$id R\"; done\n",
           "sh", config.queue_name}};
}

// HTCondor.

/// A word of `arguments` in a submit description: in single quotes, which stand twice where they
/// are meant, as double quotes do within the whole. HTCondor expands `$(...)` and `$NAME(...)` when
/// it reads the description, and `$$(...)` when the allocation starts; it has macros for the signs
/// themselves.
std::string quoted_for_condor(std::string_view text) {
  std::string quoted = "'";
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool is_pair = text.substr(i).starts_with("$$");
    if (is_pair) ++i;
    if (text[i] == '$') {
      quoted += is_pair ? "$$(DOLLARDOLLAR)" : "$(DOLLAR)";
      continue;
    }
    quoted += text[i];
    if (text[i] == '\'' || text[i] == '"') quoted += text[i];
  }
  return quoted + "'";
}

BatchCommand condor_submission(const FactoryConfig& config) {
  std::string description = fmt::format(
      "universe = vanilla\n"
      "executable = /bin/bash\n"
      "transfer_executable = false\n"
      "arguments = \"-c {} bash $(ClusterId).$(ProcId)\"\n"
      "batch_name = {}\n"
      "getenv = true\n",
      quoted_for_condor(config.worker_command), config.queue_name);
  if (config.num_processors) {
    description += fmt::format("request_cpus = {}\n", *config.num_processors);
  }
  for (const std::string& option : config.submit_options) description += option + "\n";
  return {{"condor_submit", "-terse", "-"}, description + "queue\n"};
}

// States: 1 waits, 2 runs, 5 is held, 7 is suspended; in the others it has ended or is about to.
BatchCommand condor_listing(const FactoryConfig& config) {
  return {{"condor_q", "-constraint",
           fmt::format("JobBatchName == \"{}\" && (JobStatus <= 2 || JobStatus == 5 || "
                       "JobStatus == 7)",
                       config.queue_name),
           "-format", "%d.", "ClusterId", "-format", "%d ", "ProcId", "-format", "%d\n",
           "JobStatus"}};
}

// This machine: workers are processes, and their numbers identify them.

BatchCommand local_submission(const FactoryConfig& config) {
  return {{"sh", "-c",
           "[ \"$(stat -c %s \"$2\" 2>/dev/null || echo 0)\" -lt 16777216 ] || mv \"$2\" \"$2.1\"\n"
           "exec 3>>\"$2\"; setsid bash -c 'set -- \"$$\"; eval \"$0\"' \"$1\" "
           ">/dev/null 2>&3 </dev/null 3>&- & echo $!",
           "sh", config.worker_command, config.workers_log}};
}

BatchCommand local_listing(const FactoryConfig&) { return {{"ps", "-e", "-o", "pid=,args="}}; }

std::vector<Allocation> local_workers(const FactoryConfig& config, std::string_view output) {
  std::vector<Allocation> allocations;
  for (const std::string& line : lines_of(output)) {
    const std::vector<std::string> words = words_of(line);
    if (words.empty()) continue;
    // Of all arguments; a worker of another coordinator may have a factory of the same name.
    const std::string mark =
        fmt::format(" --connect {} --name {}-{} ", config.worker_endpoint, config.name, words[0]);
    if ((line + " ").find(mark) == std::string::npos) continue;
    allocations.push_back({words.front(), true});
  }
  return allocations;
}

// Commands.

constexpr std::chrono::seconds command_wait{60};
constexpr std::size_t output_size_max = 1 << 20;

}  // namespace

const std::vector<BatchSystem>& batch_systems() {
  static const std::vector<BatchSystem> systems{
      {"slurm", slurm_submission, slurm_listing, "squeue", "RUNNING", {"scancel"}},
      {"pbs", pbs_submission, pbs_listing, "qselect", "R", {"qdel"}},
      {"condor", condor_submission, condor_listing, "condor_q", "2", {"condor_rm"}},
      {"local", local_submission, local_listing, "ps", "", {"kill"}}};
  return systems;
}

// The first word: of Slurm `4711`, or `4711;cluster` where there are several; of HTCondor
// `12.0 - 12.0`, the first and the last.
std::string id_in(std::string_view output, std::string_view program) {
  const std::vector<std::string> words = words_of(std::string(output.substr(0, output.find(';'))));
  return checked_id(program, words.empty() ? "" : words.front());
}

std::vector<Allocation> allocations_of(const BatchSystem& system, const FactoryConfig& config,
                                       std::string_view output) {
  if (system.running.empty()) return local_workers(config, output);
  std::vector<Allocation> allocations;
  for (const std::string& line : lines_of(output)) {
    const std::vector<std::string> words = words_of(line);
    if (words.size() != 2) {
      throw Error(fmt::format("{}: line = \"{}\" (must be an identifier and a state)",
                              system.lister, line));
    }
    allocations.push_back({checked_id(system.lister, words[0]), words[1] == system.running});
  }
  return allocations;
}

std::string output_of(const BatchCommand& command) {
  const std::string& program = command.arguments.front();
  const wire::UnnamedFile input(memfd_create("input", MFD_CLOEXEC));
  const wire::UnnamedFile output(memfd_create("output", MFD_CLOEXEC));
  const wire::UnnamedFile errors(memfd_create("errors", MFD_CLOEXEC));
  const ssize_t written = pwrite(input.descriptor(), command.input.data(), command.input.size(), 0);
  if (written != static_cast<ssize_t>(command.input.size())) {
    throw Error(fmt::format("{}: no memory for its input", program));
  }
  const pid_t process_id = wire::start_program(
      {.arguments = command.arguments,
       .descriptors = {input.descriptor(), output.descriptor(), errors.descriptor()}});
  const auto deadline = std::chrono::steady_clock::now() + command_wait;
  const std::optional<int> status =
      wire::status_at_end(process_id, [&] { return std::chrono::steady_clock::now() <= deadline; });
  if (!status) throw Error(fmt::format("{}: did not end within a minute", program));
  if (*status == 0) return output.read(0, output_size_max);
  const std::vector<std::string> words = lines_of(errors.read(0, output_size_max));
  throw Error(fmt::format("{}: {}{}", program, wire::end_text(*status),
                          words.empty() ? "" : ": " + words.back()));
}

namespace {

void cancel(const std::string& id, const BatchSystem& system, const wire::Log& log) {
  try {
    BatchCommand command{system.canceller};
    command.arguments.push_back(id);
    (void)output_of(command);
    log(wire::Event::info("allocation_cancelled", {{"allocation", id}}));
  } catch (const Error& error) {
    log(wire::Event::warning("cancellation_failed",
                             {{"allocation", id}, wire::Field::reason(error.what())}));
  }
}

/// @return Whether the batch system took it.
bool submit(FactoryState& state, const BatchSystem& system, const FactoryConfig& config,
            const wire::Log& log) {
  const auto now = std::chrono::steady_clock::now();
  try {
    const BatchCommand command = system.submission(config);
    const std::string id = id_in(output_of(command), command.arguments.front());
    on_submitted(state, id, now);
    log(wire::Event::info("worker_requested", {{"allocation", id}}));
    return true;
  } catch (const Error& error) {
    on_submission_failed(state, error.what(), now, log);
    return false;
  }
}

}  // namespace

void carry_out(const FactoryActions& actions, FactoryState& state, const BatchSystem& system,
               const FactoryConfig& config, const wire::Log& log) {
  for (const std::string& id : actions.cancelled) cancel(id, system, log);
  for (std::uint64_t i = 0; i < actions.num_submissions; ++i) {
    if (!submit(state, system, config, log)) return;
  }
}

}  // namespace proofmass::coordinator
