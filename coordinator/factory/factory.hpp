#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "proto/client.pb.h"
#include "proto/text/event.hpp"

namespace proofmass::coordinator {

using FactoryTime = std::chrono::steady_clock::time_point;

/// How many workers a factory keeps, and what each of its allocations is to be.
struct FactoryConfig {
  std::string name = "proofmass";  ///< A worker's name is NAME-ID. is_name() holds.
  /// Of its allocations, by which a factory that is started again finds them; no other factory and
  /// nobody else gives it to theirs.
  std::string queue_name = {};
  std::uint64_t workers_min = 0;  ///< Kept while any run is open.
  std::uint64_t workers_max =
      10;                     ///< Allocations, queued and running together; >= workers_min, > 0.
  std::uint64_t backlog = 1;  ///< Allocations at most that have no registered worker yet; > 0.
  std::chrono::seconds walltime = std::chrono::hours(8);  ///< Of an allocation.
  /// Share of its walltime, in (0, 1], that a worker must find work for, or it is not asked for.
  double utilisation_min = 0.1;
  std::string worker_endpoint = {};  ///< The coordinator's address for workers.
  /// A line of bash that ends as `proofmass-worker --connect ADDRESS --name NAME-"$1" ...`.
  std::string worker_command = {};
  std::optional<unsigned> num_processors = {};   ///< Of a worker; nothing: a node of its own.
  std::vector<std::string> submit_options = {};  ///< Further ones, as the batch system has them.
  std::string batch_system = {};                 ///< Its name.
  std::string workers_log = {};   ///< File of local workers' standard error; else empty.
  std::uint64_t interval_s = 30;  ///< Between two looks.
};

/// A worker's place in the queue of a batch system.
struct Allocation {
  std::string id;           ///< As the batch system calls it: `4711`, `17.cluster`, `12.0`.
  bool is_running = false;  ///< It has a node; else it waits for one.
};

/// What coordinator and batch system say at one moment.
struct FactoryView {
  std::uint64_t num_open_runs = 0;           ///< Of active campaigns: neither stored nor given up.
  double rate_hz = 0.0;                      ///< Runs that all workers together finish per second.
  std::set<std::string> workers = {};        ///< Names of all registered workers, of any origin.
  std::vector<Allocation> allocations = {};  ///< Of this factory.
};

/// What a factory remembers. It may be lost at any time: the next factory of the same name finds
/// the allocations in the queue and the workers at the coordinator.
struct FactoryState {
  struct Known {
    bool has_registered = false;
    bool is_cancelled = false;
    FactoryTime seen;                          ///< Last in the queue.
    std::optional<FactoryTime> running_since;  ///< As far as this factory saw.
  };
  std::map<std::string, Known> allocations;  ///< By id.
  double rate_per_worker_hz = 0.0;           ///< As last measured; 0: not yet.
  int num_failed_submissions = 0;            ///< In a row.
  int num_failed_starts = 0;                 ///< In a row.
  FactoryTime next_submission;               ///< Not before.
  std::string failure;                       ///< The last one, in words.
};

/// What is to be done now.
struct FactoryActions {
  std::uint64_t num_submissions = 0;
  std::vector<std::string> cancelled;  ///< Identifiers of allocations.
};

/// Workers that the open runs are worth: as many as each find work for `utilisation_min` of their
/// walltime at the rate of one, at least `workers_min` and one, at most `workers_max`. None if no
/// run is open. Before a rate is known, as many as there are, or one.
[[nodiscard]] std::uint64_t wanted_workers(const FactoryConfig& config, const FactoryView& view,
                                           double rate_per_worker_hz);

/// Looks at the moment, and decides.
///
/// A worker counts once it is registered with the coordinator, whatever the queue says. An
/// allocation whose worker has not registered five minutes after it began to run is cancelled, and
/// counts as a failed start, as does one that leaves the queue without having registered.
///
/// @param log  Is told of failed starts and of what is decided.
[[nodiscard]] FactoryActions on_view(FactoryState& state, const FactoryConfig& config,
                                     const FactoryView& view, FactoryTime now,
                                     const wire::Log& log);

/// The batch system has taken an allocation.
void on_submitted(FactoryState& state, const std::string& id, FactoryTime now);

/// The batch system refused one: the next is submitted after 1, 15, 30 and then every 60 minutes.
void on_submission_failed(FactoryState& state, const std::string& reason, FactoryTime now,
                          const wire::Log& log);

/// Why the factory submits nothing more: ten submissions or three starts have failed in a row.
/// Nothing if all is well. Once there is a reason, there is one as long as the state lives.
[[nodiscard]] std::optional<std::string> reason_to_pause(const FactoryState& state);

/// What the factory tells the coordinator after a look.
[[nodiscard]] proto::FactoryReport report_of(const FactoryState& state, const FactoryConfig& config,
                                             const FactoryView& view, FactoryTime now);

struct BatchCommand {
  std::vector<std::string> arguments;  ///< With the program, which is looked for in PATH.
  std::string input = {};              ///< On its standard input.
};

/// What a batch system understands.
struct BatchSystem {
  std::string_view name;  ///< As people choose it: `slurm`.
  /// Puts one allocation into the queue, and prints its identifier.
  BatchCommand (*submission)(const FactoryConfig& config);
  /// Lists the allocations of the factory, a line `ID STATE` each.
  BatchCommand (*listing)(const FactoryConfig& config);
  std::string_view lister;   ///< The program that lists them.
  std::string_view running;  ///< The state of those that have a node; empty: see allocations_of().
  std::vector<std::string> canceller;  ///< A command that the identifier completes.
};

/// slurm, pbs, condor and local; `local` starts workers on this machine, for trials.
[[nodiscard]] const std::vector<BatchSystem>& batch_systems();

/// The identifier of an allocation, in what the program printed that put it into the queue.
/// @throws Error if there is none.
[[nodiscard]] std::string id_in(std::string_view output, std::string_view program);

/// The allocations in what `listing` printed; of a system without states, which is `local`, the
/// workers of the factory among all processes.
/// @throws Error if it cannot be read.
[[nodiscard]] std::vector<Allocation> allocations_of(const BatchSystem& system,
                                                     const FactoryConfig& config,
                                                     std::string_view output);

/// Starts the program and waits for its end, at most a minute.
/// @return What it wrote to standard output, at most 1 MiB of it.
/// @throws Error with the program's name and its last words if it cannot be started, does not end
///         in time, or ends with another exit code than 0.
[[nodiscard]] std::string output_of(const BatchCommand& command);

/// Has the batch system cancel and take the allocations that were decided on.
///
/// An allocation that cannot be cancelled changes nothing else: it has ended already, or its worker
/// leaves when it finds no work. After a submission that is refused no further one is tried.
///
/// @param log  Is told of each of them.
void carry_out(const FactoryActions& actions, FactoryState& state, const BatchSystem& system,
               const FactoryConfig& config, const wire::Log& log);

}  // namespace proofmass::coordinator
