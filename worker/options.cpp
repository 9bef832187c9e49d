#include "worker/options.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <map>

#include "core/error.hpp"
#include "core/model.hpp"
#include "proto/command_line/option_checks.hpp"
#include "proto/link/faults.hpp"
#include "proto/link/machine.hpp"
#include "proto/wire/messages.hpp"

namespace proofmass::worker {
namespace {

constexpr unsigned threads_max = 256;

/// The year 2286: ten digits, so that a time in milliseconds is refused.
constexpr std::int64_t end_time_unix_s_max = 9'999'999'999;

constexpr std::uint64_t seconds_max = std::uint64_t{366} * 24 * 3600;

/// Seconds in the unit; nothing if there is no such unit.
std::optional<std::uint64_t> seconds_in(std::string_view unit) {
  static const std::map<std::string_view, std::uint64_t> units{
      {"", 1}, {"s", 1}, {"m", 60}, {"h", 3600}, {"d", 86400}};
  const auto found = units.find(unit);
  return found == units.end() ? std::nullopt : std::optional(found->second);
}

/// Declares an option whose value is a time.
template <typename Target>
CLI::Option* add_duration(CLI::App& app, const std::string& name, Target& target,
                          const std::string& description) {
  return app.add_option_function<std::string>(
      "--" + name, [name, &target](const std::string& text) { target = duration_from(name, text); },
      description);
}

void add_connection(CLI::App& app, Options& options) {
  app.add_option("--connect", options.endpoint,
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
  add_duration(app, "give-up-after", options.give_up_after,
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
  app.add_option("--spool", options.spool,
                 "File for results that are not acknowledged\nwhen the worker ends")
      ->type_name(wire::file_type)
      ->envname("PROOFMASS_SPOOL");
  add_duration(app, "max-walltime", options.walltime_max,
               "Time after which the worker must have ended,\ne.g. 3600, 90m, 2h")
      ->envname("PROOFMASS_MAX_WALLTIME");
  app.add_option("--end-time", options.end_time_unix_s,
                 "When the worker must have ended, in seconds\nsince 1970 (UTC), as Slurm sets it")
      ->envname("SLURM_JOB_END_TIME")
      ->check(wire::in_range(std::int64_t{0}, end_time_unix_s_max));
  add_duration(app, "idle-timeout", options.idle_timeout,
               "Leave after this time without a run; by default\nthe worker waits for work")
      ->envname("PROOFMASS_IDLE_TIMEOUT");
  add_duration(app, "drain-time", options.drain_time,
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

Duration duration_from(std::string_view option, std::string_view text) {
  std::uint64_t count = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), count);
  const auto unit = seconds_in(text.substr(static_cast<std::size_t>(end - text.data())));
  if (error != std::errc{} || !unit || count < 1 || count > seconds_max / *unit) {
    throw InvalidArgument(
        fmt::format("{} = {} (must be 1 or more, in seconds or with s, m, h or d; at most 366d)",
                    option, text));
  }
  return std::chrono::seconds(count * *unit);
}

}  // namespace proofmass::worker
