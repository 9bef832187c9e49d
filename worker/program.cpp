#include "worker/program.hpp"

#include <fmt/format.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <map>
#include <memory>
#include <new>
#include <span>
#include <string>
#include <utility>

#include "core/campaign/device.hpp"
#include "core/campaign/name.hpp"
#include "core/error.hpp"
#include "core/model.hpp"
#include "proto/command_line/option_checks.hpp"
#include "proto/link/faults.hpp"
#include "proto/link/machine.hpp"
#include "proto/model_program/described_model.hpp"
#include "proto/model_program/model_choice.hpp"
#include "proto/model_program/program_model.hpp"
#include "proto/text/visible_text.hpp"
#include "proto/wire/endpoint.hpp"
#include "proto/wire/messages.hpp"
#include "proto/wire/names.hpp"
#include "worker/gpu/cuda_device.hpp"
#include "worker/supervision/supervisor.hpp"

namespace proofmass::worker {
namespace {

constexpr unsigned threads_max = 256;

/// The year 2286: ten digits, so that a time in milliseconds is refused.
constexpr std::int64_t end_time_unix_s_max = 9'999'999'999;

void add_connection(CLI::App& app, Options& options) {
  app.add_option("--connect", options.serving.endpoint,
                 "Where the coordinator listens, ipc://PATH or\ntcp://HOST:PORT")
      ->envname("PROOFMASS_CONNECT")
      ->required();
  app.add_option("--keys", options.keys, "Directory with worker.key and coordinator.pub")
      ->type_name(wire::directory_type)
      ->envname("PROOFMASS_KEYS");
  app.add_flag("--insecure-plain", options.is_plain_waived,
               "Allow an address beyond this machine without\nkeys: on a network that you trust");
  app.add_option("--name", options.name, "Name in logs and database; HOST-PID by default")
      ->envname("PROOFMASS_NAME");
  wire::add_duration(app, "--give-up-after", options.give_up_after,
                     "How long the coordinator may be silent; 1h by\ndefault")
      ->envname("PROOFMASS_GIVE_UP_AFTER");
}

void add_work(CLI::App& app, Options& options) {
  app.add_option("--threads", options.num_threads,
                 "Threads that simulate, one a processor by default")
      ->envname("PROOFMASS_THREADS")
      ->check(wire::in_range(1U, threads_max));
  app.add_option(
         "--gpu", options.gpus,
         "NVIDIA cards that simulate, too: none, all, or\nnumbers as in 0,1; none by default")
      ->type_name("CARDS")
      ->envname("PROOFMASS_GPU");
  app.add_option("--gpu-check", options.gpu_check,
                 "Part of a card's runs that a processor computes\nagain; 0.001 by default")
      ->envname("PROOFMASS_GPU_CHECK")
      ->check(wire::in_range(0.0, 1.0));
  app.add_option("--spool", options.serving.spool,
                 "File for results that are not acknowledged\nwhen the worker ends")
      ->type_name(wire::file_type)
      ->envname("PROOFMASS_SPOOL");
  wire::add_duration(app, "--max-walltime", options.walltime_max,
                     "Time after which the worker must have ended,\ne.g. 3600, 90m, 2h")
      ->envname("PROOFMASS_MAX_WALLTIME");
  app.add_option("--end-time", options.end_time_unix_s,
                 "When the worker must have ended, in seconds\nsince 1970 (UTC), as Slurm sets it")
      ->envname("SLURM_JOB_END_TIME")
      ->check(wire::in_range(std::int64_t{0}, end_time_unix_s_max));
  wire::add_duration(app, "--idle-timeout", options.serving.conversation.idle_timeout,
                     "Leave after this time without a run; by default\nthe worker waits for work")
      ->envname("PROOFMASS_IDLE_TIMEOUT");
  wire::add_duration(app, "--drain-time", options.serving.conversation.drain_time,
                     "Time to finish and deliver after SIGTERM; 100s\nby default")
      ->envname("PROOFMASS_DRAIN_TIME");
}

void add_process(CLI::App& app, Options& options) {
  wire::add_option_file(app, "File with these options, as in\n`connect = \"tcp://a:5555\"`");
  static const std::map<std::string, wire::LogFormat> formats{{"json", wire::LogFormat::json},
                                                              {"text", wire::LogFormat::text}};
  wire::add_choice(app, "--log-format", options.log_format, formats,
                   "Format of the log; text by default")
      ->envname("PROOFMASS_LOG_FORMAT");
  app.add_flag_callback(
      "--no-supervisor", [&options] { options.is_supervised = false; },
      "Do not watch the worker from a second process,\nwhich starts it again if it crashes");
  app.add_option("--parent", options.parent)->group("");  // For `proofmass run`.
  wire::add_fault_option(app);
}

}  // namespace

void add_options(CLI::App& app, Options& options) {
  add_connection(app, options);
  add_work(app, options);
  add_process(app, options);
}

unsigned num_threads_of(const Options& options, std::size_t num_cards) {
  if (options.num_threads) return *options.num_threads;
  const unsigned num_processors = std::min(wire::num_processors(), threads_max);
  return num_processors - std::min(num_processors - 1, static_cast<unsigned>(num_cards));
}

namespace {

using wire::Field;

constexpr int exit_failed = 1;
constexpr int exit_usage = 2;
constexpr std::chrono::seconds give_up_with_parent(60);
/// A thread that computes looks whether it is still wanted each time its runs report progress.
constexpr std::chrono::seconds thread_end_max(5);

/// A worker that a campaign started must not outlive it, however that ends.
void die_with(pid_t parent) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != parent) throw Error("the program that started this worker has ended");
}

/// What computes beside the threads.
struct Cards {
  std::vector<std::shared_ptr<Device>> devices;
  std::size_t capacity = 0;  ///< Runs at a time, of all together.
  std::map<std::string, int> num_of_kind;
};

/// `2 NVIDIA H100 80GB HBM3 (CUDA 13.0)`, as the driver says; empty without cards.
std::string text_of(const Cards& cards) {
  std::string text;
  for (const auto& [kind, count] : cards.num_of_kind) {
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", count, kind);
  }
  std::ranges::replace_if(
      text, [](char letter) { return letter < ' ' || letter > '~'; }, '?');
  text.resize(std::min(text.size(), wire::cards_text_size_max));
  return text;
}

/// Where they are not there, a driver may be loaded before a service starts the worker again, but
/// not before a campaign does.
std::vector<CudaCard> cards_of(const Options& options) {
  try {
    return cuda_cards_of(options.gpus);
  } catch (const DeviceError& error) {
    if (options.parent) throw InvalidArgument(error.what());
    throw;
  }
}

/// Opens the cards that the options name and has each prove that it computes as processors do.
Cards open_cards(const Options& options, std::uint64_t reference_digest, const wire::Log& log) {
  Cards cards;
  for (const CudaCard& card : cards_of(options)) {
    auto device = std::make_shared<CudaDevice>(card);
    const std::optional<Model::DeviceProof> proof = built_in_model().prove(*device);
    if (!proof) throw InvalidArgument("gpu = " + options.gpus + " (this build has no kernels)");
    if (proof->digest != reference_digest) {
      throw DeviceError(
          fmt::format("card {}: computes other results than processors do: {:016x}, not {:016x}",
                      card.index, proof->digest, reference_digest));
    }
    log(wire::Event::info("card_ready", {{"card", static_cast<std::uint64_t>(card.index)},
                                         {"name", card.name},
                                         {"slots", std::uint64_t{proof->capacity}}}));
    cards.devices.push_back(std::move(device));
    cards.capacity += proof->capacity;
    ++cards.num_of_kind[card.name];
  }
  return cards;
}

/// One whose program cannot compute its reference runs, or not the same again, is left out, unless
/// there is no other.
void add_models(const Options& options, proto::Hello& hello, const wire::Log& log) {
  std::string failure;
  for (const Model* const model : models()) {
    const std::string version(model->version());
    const bool is_program = !model->description().empty();
    if (is_program) log(wire::Event::info("reference_runs", {{"model", version}}));
    std::uint64_t digest = 0;
    try {
      digest = model->reference_digest(best_instruction_set());
      if (!options.parent) wire::require_repeatable(*model);  // Else the campaign has done so.
    } catch (const Error& error) {
      failure = error.what();
      log(wire::Event::warning("model_left_out", {{"model", version}, Field::reason(failure)}));
      continue;
    }
    if (model == &built_in_model()) {
      hello.set_model_version(version);
      hello.set_reference_digest(digest);
    } else {
      proto::OtherModel& other = *hello.add_other_models();
      other.set_version(version);
      other.set_reference_digest(digest);
      other.set_description_digest(model->description_digest());
    }
  }
  if (!failure.empty() && hello.other_models_size() == 0) throw Error(failure);
}

proto::Hello hello_for(const Options& options, const ChildStart& start, const wire::Log& log) {
  const auto process_id = static_cast<std::uint64_t>(getpid());
  proto::Hello hello;
  hello.set_host(wire::host_name());
  hello.set_worker_name(options.name.empty()
                            ? wire::name_from(fmt::format("{}-{}", hello.host(), process_id))
                            : options.name);
  hello.set_process_id(process_id);
  hello.set_build(PROOFMASS_VERSION);
  add_models(options, hello, log);
  if (start.former) *hello.mutable_former() = *start.former;
  if (!wire::is_name(hello.worker_name())) {
    throw InvalidArgument(fmt::format("name = {} ({})", hello.worker_name(), is_name_rule));
  }
  return hello;
}

SignalSource signal_source(const Options& options) {
  if (options.parent) return SignalSource::campaign;
  return options.is_supervised ? SignalSource::supervisor : SignalSource::anyone;
}

wire::ClientSecurity security_for(const Options& options, const wire::Log& log) {
  wire::check_endpoint("connect", options.serving.endpoint, wire::EndpointUse::connect,
                       wire::protection_by(options.keys, options.is_plain_waived));
  if (options.keys) return wire::read_client_security(*options.keys, wire::KeyRole::worker);
  if (!wire::is_local(options.serving.endpoint)) {
    log(wire::Event::warning(
        "insecure_plain",
        {{"connect", options.serving.endpoint},
         Field::remark("(anybody on the network can read and change messages)")}));
  }
  return {};
}

/// @throws InvalidArgument if it has passed: then the variable is that of a job long ago.
TimePoint allocation_end(std::int64_t end_time_unix_s, TimePoint program_start) {
  const auto end = std::chrono::sys_seconds(std::chrono::seconds(end_time_unix_s));
  const auto time_left = end - std::chrono::system_clock::now();
  if (time_left <= Duration::zero()) {
    throw InvalidArgument(
        fmt::format("end-time = {} (must be in the future; from --end-time or SLURM_JOB_END_TIME)",
                    end_time_unix_s));
  }
  return program_start + std::chrono::duration_cast<Duration>(time_left);
}

/// The earlier of both ends, if there are any.
std::optional<TimePoint> walltime_end(const Options& options, TimePoint program_start) {
  std::optional<TimePoint> end;
  if (options.walltime_max) end = program_start + *options.walltime_max;
  if (options.end_time_unix_s) {
    const TimePoint end_there = allocation_end(*options.end_time_unix_s, program_start);
    end = std::min(end.value_or(end_there), end_there);
  }
  return end;
}

/// @throws InvalidArgument if a worker would have to leave before it is there.
void require_time(const ConversationConfig& conversation, TimePoint program_start) {
  if (!conversation.walltime_end) return;
  const auto seconds = [](Duration time) { return std::chrono::duration<double>(time).count(); };
  const Duration time_left = *conversation.walltime_end - program_start;
  const Duration needed = 2 * conversation.delivery_time;  // As Conversation::time_to_leave().
  if (time_left > needed) return;
  throw InvalidArgument(fmt::format(
      "walltime = {:.0f} s (must be more than {:.0f} s, which a worker needs to end; from "
      "--max-walltime, --end-time or SLURM_JOB_END_TIME)",
      seconds(time_left), seconds(needed)));
}

ServeConfig serve_config(const Options& options, TimePoint program_start, const wire::Log& log) {
  ServeConfig config = options.serving;
  config.log = log;
  config.security = security_for(options, log);
  config.signals = signal_source(options);
  ConversationConfig& conversation = config.conversation;
  if (options.parent) conversation.give_up_after = give_up_with_parent;
  if (options.give_up_after) conversation.give_up_after = *options.give_up_after;
  conversation.walltime_end = walltime_end(options, program_start);
  require_time(conversation, program_start);
  return config;
}

/// Ends the process without waiting for anything.
[[noreturn]] void exit_at_once(int exit_code) {
  std::fflush(nullptr);
  _exit(exit_code);
}

/// Turns what goes wrong into a message and an exit code. After an error of a card it ends the
/// process: a driver may wait for a card that hangs as the process exits.
int reporting_errors(const Program& program, const std::function<int()>& what) {
  const auto fail = [&](const std::exception& error, int exit_code) {
    wire::say(fmt::format("{}: error: {}\n", program.name, error.what()));
    return exit_code;
  };
  try {
    return what();
  } catch (const InvalidArgument& error) {
    return fail(error, exit_usage);
  } catch (const DeviceError& error) {
    exit_at_once(fail(error, exit_failed));
  } catch (const std::bad_alloc&) {
    return fail(Error("memory = too little (raise `ulimit -v`, or the limit of the service, "
                      "container or job)"),
                exit_failed);
  } catch (const std::exception& error) {
    return fail(error, exit_failed);
  }
}

/// @return 0, or it throws.
int say_ended(const Ending& ending, const wire::Log& log) {
  if (ending.kind == Ending::Kind::failed) throw Error(ending.reason);
  log(wire::Event::info("worker_ended", {Field::reason(ending.reason)}));
  return 0;
}

/// The worker itself; 0, or it throws, or it ends the process because threads do not end.
int work(const Options& options, const Program& program, ServeConfig config,
         const ChildStart& start) {
  constexpr int num_threads_beside = 4;  // ZeroMQ's, and one for heartbeats.
  config.session = start.session;
  config.on_registered = start.note_registered;
  config.hello = hello_for(options, start, config.log);
  const Cards cards = open_cards(options, config.hello.reference_digest(), config.log);
  const unsigned num_threads = num_threads_of(options, cards.devices.size());
  const std::size_t num_processor_slots = num_threads * wire::slots_per_thread();
  const std::size_t num_card_slots =
      std::min(cards.capacity, wire::slots_max - num_processor_slots);
  config.hello.set_num_slots(static_cast<std::uint32_t>(num_processor_slots + num_card_slots));
  config.hello.set_slots_per_thread(static_cast<std::uint32_t>(wire::slots_per_thread()));
  config.hello.set_num_card_slots(static_cast<std::uint32_t>(num_card_slots));
  config.hello.set_cards(text_of(cards));
  constexpr std::size_t num_threads_a_card = 5;  // Its own, and those of its driver.
  wire::require_threads(static_cast<int>(num_threads + num_threads_a_card * cards.devices.size()) +
                        num_threads_beside);
  StopSignals signals(config.signals);
  const wire::Wake progress;
  Executor executor(program.prepare, [&progress] { progress.notify(); },
                    {.num_threads = num_threads,
                     .batch_size_max = wire::slots_per_thread(),
                     .devices = cards.devices,
                     .checked_fraction = options.gpu_check});
  const Ending ending = serve(config, executor, progress, signals);
  if (!executor.end_within(thread_end_max)) {
    config.log(wire::Event::error(
        "computation_hangs",
        {Field::reason(ending.reason), Field::remark("(the process ends without it)")}));
    exit_at_once(exit_hung);
  }
  const auto conclude = [&] { return say_ended(ending, config.log); };
  // Nothing is lost with a preparation, which cannot be interrupted and may take minutes, nor with
  // a card, which may hang.
  if (executor.is_preparing() || !cards.devices.empty()) {
    exit_at_once(reporting_errors(program, conclude));
  }
  return conclude();
}

/// @param left_out  What is wrong with programs of models.
int run(const Options& options, const Program& program, std::span<const std::string> left_out) {
  const TimePoint program_start = std::chrono::steady_clock::now();
  wire::ignore_broken_pipes();  // What reads the log must not take results with it.
  const wire::Log log =
      wire::make_log(program.name, options.log_format,
                     options.parent ? wire::LogLevel::warning : wire::LogLevel::info);
  for (const std::string& why : left_out) {
    log(wire::Event::warning("model_left_out", {Field::reason(why)}));
  }
  if (options.parent) {
    die_with(*options.parent);
    std::signal(SIGINT, SIG_IGN);  // Ctrl-C reaches the campaign, which tells its workers.
  }
  const ServeConfig config = serve_config(options, program_start, log);
  const auto work_from = [&](const ChildStart& start) {
    return work(options, program, config, start);
  };
  if (signal_source(options) != SignalSource::supervisor) {
    return work_from({.session = {wire::random_number()}, .former = std::nullopt});
  }
  wire::end_fresh_programs();
  return supervise(
      [&](const ChildStart& start) {
        return reporting_errors(program, [&] { return work_from(start); });
      },
      log);
}

}  // namespace

int run_worker(int argc, char** argv, const Program& program) {
  Options options;
  CLI::App app(
      "Simulates runs for a proofmass coordinator.\n"
      "On SIGTERM it finishes and delivers its batches; on a second one it exits.",
      program.name);
  app.footer(
      "Exit codes:\n"
      "  0    told to end\n"
      "  1    cannot go on\n"
      "  2    wrong usage\n"
      "  3    a computation hangs");
  add_options(app, options);
  program.add_options(app);
  wire::add_model_program_option(app);
  app.set_version_flag(
      "--version", fmt::format("{} {} ({})", program.name, PROOFMASS_VERSION, model().version()));
  return reporting_errors(program, [&] {
    wire::settle_surroundings();
    const auto left_out =
        wire::choose_models(argc, argv, wire::Broken::left_out, [](const std::string&) {});
    // Without any of its programs it is not the worker that somebody meant.
    if (!left_out.empty() && models().front() == &built_in_model()) throw Error(left_out.front());
    try {
      app.parse(argc, argv);
    } catch (const CLI::Success& wish) {
      return app.exit(wish);  // --help or --version.
    } catch (const CLI::ParseError& error) {
      throw InvalidArgument(wire::refusal_of(app, error));
    }
    return run(options, program, left_out);
  });
}

int run_proofmass_worker(int argc, char** argv) {
  return run_worker(argc, argv, {.name = "proofmass-worker"});
}

}  // namespace proofmass::worker
