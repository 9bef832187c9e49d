// Many workers in one process, whose runs compute nothing: what a coordinator has to bear. With
// --batch-time-s runs take the time of real ones.
//
// Prints a line of JSON once all workers are registered, and one each second from then on; ends
// when the coordinator has told all of them to. With --idle there are connections beside them of
// which nobody says anything, and with --churn some of those are replaced each second; without
// workers it goes on until it is killed.

#include <sys/epoll.h>
#include <sys/resource.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <deque>
#include <exception>
#include <filesystem>
#include <iostream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <random>
#include <string>
#include <system_error>
#include <vector>
#include <zmq.hpp>

#include "core/microscope/simulation/reference_digest.hpp"
#include "core/microscope/simulation/run.hpp"
#include "proto/link/keys.hpp"
#include "proto/link/socket.hpp"
#include "tests/benchmarks/swarm_worker.hpp"

namespace {

using namespace proofmass;
using test::seconds;
using test::SwarmCount;
using test::SwarmWorker;
using test::time_now;
using TimePoint = SwarmWorker::TimePoint;

constexpr std::chrono::milliseconds tick_interval(100);
constexpr std::chrono::seconds report_interval(1);

struct SwarmOptions {
  test::SwarmWorkerConfig worker;
  std::optional<std::filesystem::path> keys;
  int num_workers = 1000;
  int first_number = 0;  ///< Of the names; each of several swarms has its own.
  int num_idle = 0;
  int num_replaced = 0;  ///< Of the idle ones, each second.
};

/// Each worker has a connection and what wakes its thread.
void raise_descriptor_limit() {
  rlimit limit{};
  getrlimit(RLIMIT_NOFILE, &limit);
  limit.rlim_cur = limit.rlim_max;
  setrlimit(RLIMIT_NOFILE, &limit);
}

wire::SessionId random_session() {
  std::random_device device;
  const std::uint64_t high = device();
  return {(high << 32) | device() | 1U};
}

proto::Hello hello_of(int number, std::uint32_t num_slots) {
  static const std::uint64_t digest = reference_digest(best_instruction_set());
  proto::Hello hello;
  hello.set_worker_name("swarm-" + std::to_string(number));
  hello.set_host("swarm-host-" + std::to_string(number / 32));
  hello.set_process_id(static_cast<std::uint64_t>(getpid()));
  hello.set_num_slots(num_slots);
  hello.set_model_version(std::string(model_version));
  hello.set_build("benchmark");
  hello.set_reference_digest(digest);
  return hello;
}

double median(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// How many there are of each whole number of milliseconds.
std::map<std::string, std::uint64_t> by_ms(const std::vector<double>& values_s) {
  std::map<std::string, std::uint64_t> counts;
  for (const double value_s : values_s) {
    ++counts[std::to_string(std::max(0L, static_cast<long>(1e3 * value_s)))];
  }
  return counts;
}

/// Connections that say nothing.
class IdleConnections {
 public:
  IdleConnections(zmq::context_t& context, const SwarmOptions& options)
      : context_(context), options_(options) {
    for (int i = 0; i < options.num_idle; ++i) sockets_.push_back(connected());
  }

  /// Closes the oldest ones that are connected, as many as are to be, and opens others.
  void replace() {
    for (int i = 0; i < options_.num_replaced && !sockets_.empty(); ++i) {
      if (!is_connected(sockets_.front())) break;
      sockets_.pop_front();
      sockets_.push_back(connected());
      ++num_replaced_;
    }
  }

  [[nodiscard]] std::ptrdiff_t num_connected() {
    return std::ranges::count_if(sockets_, [](auto& socket) { return is_connected(socket); });
  }
  [[nodiscard]] int num_replaced() const { return num_replaced_; }

 private:
  [[nodiscard]] zmq::socket_t connected() const {
    zmq::socket_t socket = wire::make_dealer(context_, options_.worker.security);
    socket.set(zmq::sockopt::linger, 0);
    socket.connect(options_.worker.endpoint);
    return socket;
  }
  /// It can send only then.
  [[nodiscard]] static bool is_connected(zmq::socket_t& socket) {
    return (socket.get(zmq::sockopt::events) & ZMQ_POLLOUT) != 0;
  }

  zmq::context_t& context_;
  const SwarmOptions& options_;
  std::deque<zmq::socket_t> sockets_;
  int num_replaced_ = 0;
};

class Swarm {
 public:
  explicit Swarm(const SwarmOptions& options)
      : epoll_(epoll_create1(EPOLL_CLOEXEC)),
        context_(context_for(options)),
        idle_(context_, options) {
    if (epoll_ < 0) throw std::system_error(errno, std::generic_category(), "epoll_create1");
    for (int i = 0; i < options.num_workers; ++i) {
      add_worker(options.worker, options.first_number + i);
    }
  }

  ~Swarm() { close(epoll_); }
  Swarm(const Swarm&) = delete;
  Swarm& operator=(const Swarm&) = delete;

  void run() {
    while (!is_over()) {
      wait();
      const TimePoint now = time_now();
      finish_runs(now);
      if (now >= tick_at_) tick(now);
      if (report_at_ && now >= *report_at_) report(now);
    }
    report(time_now());
  }

 private:
  void add_worker(const test::SwarmWorkerConfig& config, int number) {
    const auto& worker = workers_.emplace_back(std::make_unique<SwarmWorker>(
        context_, config, random_session(), hello_of(number, config.num_slots), count_, start_));
    epoll_event event{.events = EPOLLIN, .data = {.ptr = worker.get()}};
    if (epoll_ctl(epoll_, EPOLL_CTL_ADD, worker->descriptor(), &event) != 0) {
      throw std::system_error(errno, std::generic_category(), "epoll_ctl");
    }
  }

  static zmq::context_t context_for(const SwarmOptions& options) {
    zmq::context_t context;
    // Replaced ones are there until the library has closed them.
    context.set(zmq::ctxopt::max_sockets, options.num_workers + 2 * options.num_idle + 16);
    return context;
  }

  [[nodiscard]] bool is_over() const {
    return !workers_.empty() &&
           std::ranges::all_of(workers_, [](const auto& worker) { return worker->has_ended(); });
  }

  void wait() {
    std::array<epoll_event, 256> events{};
    const int timeout_ms = tick_interval.count() / 10;
    const int count = epoll_wait(epoll_, events.data(), events.size(), timeout_ms);
    for (int i = 0; i < count; ++i) {
      static_cast<SwarmWorker*>(events[static_cast<std::size_t>(i)].data.ptr)->serve(time_now());
    }
  }

  void finish_runs(TimePoint now) {
    for (const auto& worker : workers_) {
      if (!worker->has_ended() && worker->is_due(now)) worker->on_due(now);
    }
  }

  void tick(TimePoint now) {
    tick_at_ = now + tick_interval;
    for (const auto& worker : workers_) {
      if (!worker->has_ended()) worker->on_tick(time_now());
    }
    const auto is_registered = [](const auto& worker) { return worker->is_registered(); };
    if (!report_at_ && std::ranges::all_of(workers_, is_registered)) report(time_now());
  }

  void report(TimePoint now) {
    report_at_ = now + report_interval;
    idle_.replace();
    std::cout << nlohmann::json{{"time_s", seconds(now - start_)},
                                {"num_registered", num_registered()},
                                {"num_idle_connected", idle_.num_connected()},
                                {"num_idle_replaced", idle_.num_replaced()},
                                {"num_results", count_.num_results},
                                {"num_unsent", count_.num_unsent},
                                {"heartbeat_answers_by_ms", by_ms(count_.heartbeat_answers_s)},
                                {"heartbeat_unanswered_s_max", unanswered_s_max(now)},
                                {"acknowledgement_s_median", median(count_.acknowledgements_s)}}
              << std::endl;
    count_ = {};
  }

  [[nodiscard]] std::ptrdiff_t num_registered() const {
    return std::ranges::count_if(workers_,
                                 [](const auto& worker) { return worker->is_registered(); });
  }

  [[nodiscard]] double unanswered_s_max(TimePoint now) const {
    double longest_s = 0.0;
    for (const auto& worker : workers_) {
      const auto time = worker->unanswered_for(now);
      if (time) longest_s = std::max(longest_s, seconds(*time));
    }
    return longest_s;
  }

  TimePoint start_ = time_now();
  TimePoint tick_at_ = start_;
  std::optional<TimePoint> report_at_;  ///< Nothing before all are registered.
  int epoll_;
  zmq::context_t context_;
  IdleConnections idle_;
  SwarmCount count_;
  std::vector<std::unique_ptr<SwarmWorker>> workers_;
};

int run(int argc, char** argv) {
  CLI::App app("Many workers in one process, whose runs compute nothing.", "proofmass-swarm");
  SwarmOptions options;
  app.add_option("--connect", options.worker.endpoint, "Address of the coordinator")->required();
  app.add_option("--workers", options.num_workers, "How many")->check(CLI::Range(0, 4096));
  app.add_option("--keys", options.keys, "Directory with worker.key and coordinator.pub");
  app.add_option("--idle", options.num_idle, "Connections beside them that say nothing")
      ->check(CLI::Range(0, 100'000));
  app.add_option("--churn", options.num_replaced, "Idle connections to replace each second")
      ->check(CLI::Range(0, 100'000));
  app.add_option("--slots", options.worker.num_slots, "Of each")->check(CLI::Range(1, 4096));
  app.add_option("--runs-held", options.worker.runs_held_max, "Most runs that each has at a time")
      ->check(CLI::Range(1, 4096));
  app.add_option("--elapsed-s", options.worker.elapsed_s,
                 "What they say that a run takes that takes no time")
      ->check(CLI::NonNegativeNumber);
  app.add_option(
         "--batch-time-s", options.worker.batch_time_s,
         "Time of a batch of 16 runs, of which each has one for 16 slots; 0: runs take none")
      ->check(CLI::Range(0.0, 3600.0));
  app.add_option("--first-number", options.first_number, "Of the workers' names")
      ->check(CLI::NonNegativeNumber);
  CLI11_PARSE(app, argc, argv);
  raise_descriptor_limit();
  if (options.keys) {
    options.worker.security = wire::read_client_security(*options.keys, wire::KeyRole::worker);
  }
  Swarm(options).run();
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& error) {
    std::fputs("proofmass-swarm: error: ", stderr);
    std::fputs(error.what(), stderr);
    std::fputc('\n', stderr);
    return 1;
  }
}
