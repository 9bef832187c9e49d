#pragma once

#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "proto/link/log.hpp"
#include "worker/execution/execution.hpp"
#include "worker/execution/executor.hpp"
#include "worker/net/serve.hpp"

namespace CLI {
class App;
}  // namespace CLI

namespace proofmass::worker {

/// What a worker is told when it starts.
struct Options {
  ServeConfig serving;  ///< Endpoint, spool, drain time and idle timeout; the rest at the start.
  std::optional<std::filesystem::path> keys;  ///< Directory; nothing: without keys.
  bool is_plain_waived = false;               ///< Without keys beyond this machine.
  std::string name;                           ///< Empty: HOST-PID.
  std::optional<unsigned> num_threads;        ///< Nothing: one a processor that serves no card.
  std::string gpus = "none";                  ///< `none`, `all` or numbers of cards as in `0,1`.
  double gpu_check = 1e-3;                    ///< Part of a card's runs that are computed again.
  std::optional<Duration> walltime_max;
  std::optional<std::int64_t> end_time_unix_s;  ///< When the job ends that the worker is part of.
  std::optional<Duration> give_up_after;        ///< Nothing: 60 s with a parent, else an hour.
  wire::LogFormat log_format = wire::LogFormat::text;
  std::optional<pid_t> parent;  ///< Campaign that started this worker, for itself alone.
  bool is_supervised = true;
};

/// Declares the options, which can also come from a file (--config) and from the environment.
///
/// @param options  Set while the arguments are parsed, which throws InvalidArgument, too; outlives
///                 `app`.
void add_options(CLI::App& app, Options& options);

/// Threads that simulate, beside those that serve cards.
[[nodiscard]] unsigned num_threads_of(const Options& options, std::size_t num_cards);

/// What makes one worker program differ from another.
struct Program {
  std::string name;                      ///< In the log and in error messages.
  Prepare prepare = &Campaign::prepare;  ///< Called after the options have been parsed.
  std::function<void(CLI::App&)> add_options = [](CLI::App&) {};  ///< Its own ones.
};

/// All of a worker, from its arguments to its exit code: 0 told to end, 1 cannot go on, 2 wrong
/// usage, 3 a computation hangs.
[[nodiscard]] int run_worker(int argc, char** argv, const Program& program);

/// `proofmass-worker`.
[[nodiscard]] int run_proofmass_worker(int argc, char** argv);

}  // namespace proofmass::worker
