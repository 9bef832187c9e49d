#include <fmt/format.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <csignal>
#include <cstdio>
#include <exception>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "core/error.hpp"
#include "core/simulation/run.hpp"
#include "proto/wire/endpoint.hpp"
#include "proto/wire/names.hpp"
#include "worker/net/serve.hpp"

namespace {

using namespace proofmass;

constexpr int exit_failed = 1;
constexpr int exit_usage = 2;
constexpr unsigned threads_max = wire::slots_max / batch_lanes;

struct Options {
  std::string endpoint;
  std::string name;
  unsigned num_threads = std::clamp(std::thread::hardware_concurrency(), 1U, threads_max);
  std::optional<pid_t> parent;
};

std::string host_name() {
  std::array<char, 256> name{};
  gethostname(name.data(), name.size() - 1);
  return wire::name_from(name.data());
}

/// A worker that a campaign started must not outlive it, however that ends.
void die_with(pid_t parent) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != parent) throw Error("parent = gone (the campaign that started this worker)");
}

/// Runs of one campaign, all with the plan that is made here.
worker::Simulate prepare(const Campaign& campaign) {
  // Shared by the copies that std::function makes.
  const auto plan = std::make_shared<const RunPlan>(campaign);
  return [plan, set = best_instruction_set()](std::span<const RunRequest> requests,
                                              const std::function<void(int)>& progress) {
    return plan->simulate_batch(requests, set, progress);
  };
}

int run(const Options& options) {
  spdlog::set_default_logger(spdlog::stderr_logger_mt("proofmass-worker"));
  if (options.parent) {
    die_with(*options.parent);
    std::signal(SIGINT, SIG_IGN);  // Ctrl-C reaches the campaign, which tells its workers.
    spdlog::set_level(spdlog::level::warn);
  }
  wire::check_endpoint("connect", options.endpoint);
  const worker::ExecutorConfig config{.num_threads = options.num_threads,
                                      .batch_size_max = batch_lanes};
  const std::string host = host_name();
  const wire::Hello hello{.worker_name = options.name.empty()
                                             ? wire::name_from(fmt::format("{}-{}", host, getpid()))
                                             : options.name,
                          .host = host,
                          .process_id = static_cast<std::uint64_t>(getpid()),
                          .num_slots = static_cast<std::uint32_t>(config.num_threads * batch_lanes),
                          .model_version = std::string(model_version)};
  if (!wire::is_name(hello.worker_name)) {
    throw InvalidArgument(
        fmt::format("name = {} (must be 1 to 128 of [A-Za-z0-9._-])", hello.worker_name));
  }
  const auto signals =
      options.parent ? worker::Signals::terminate : worker::Signals::terminate_and_interrupt;
  const worker::Ending ending = worker::serve(options.endpoint, hello, prepare, config, signals);
  if (ending.kind == worker::Ending::Kind::failed) throw Error(ending.reason);
  spdlog::info("worker_ended reason=\"{}\"", ending.reason);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app(
      "Simulates runs for a proofmass coordinator.\n"
      "Exit codes: 0 told to end, 1 cannot go on, 2 wrong usage.");
  app.add_option("--connect", options.endpoint,
                 "Where the coordinator listens: ipc://PATH or tcp://127.0.0.1:PORT")
      ->required();
  app.add_option("--name", options.name, "Name in logs and database; HOST-PID by default");
  app.add_option("--threads", options.num_threads,
                 "Threads that simulate, one a processor by default")
      ->check(CLI::Range(1U, threads_max));
  app.add_option("--parent", options.parent, "Process to die with; used by `proofmass run`");
  app.set_version_flag("--version", "proofmass-worker " PROOFMASS_VERSION);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : exit_usage;
  }
  try {
    return run(options);
  } catch (const InvalidArgument& error) {
    fmt::print(stderr, "proofmass-worker: error: {}\n", error.what());
    return exit_usage;
  } catch (const std::exception& error) {
    fmt::print(stderr, "proofmass-worker: error: {}\n", error.what());
    return exit_failed;
  }
}
