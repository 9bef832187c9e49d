#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "coordinator/dispatch/outbox.hpp"
#include "coordinator/dispatch/state.hpp"
#include "coordinator/net/authentication/rights.hpp"
#include "coordinator/net/campaign_files.hpp"
#include "coordinator/net/service_snapshot.hpp"
#include "coordinator/store/store_writer.hpp"
#include "proto/wire/client_codec.hpp"

namespace proofmass::coordinator {

class Background;

/// How a service is asked to end; set by signal handlers.
enum class StopRequest : std::uint8_t {
  none,
  drain,  ///< Ends when the runs that workers hold are stored, or after ServiceConfig::drain_max.
  now,    ///< Stores what has been delivered and ends; workers end as well.
  leave,  ///< Stores what has been delivered and ends; workers wait for the next coordinator.
};

/// Whether a service ends by itself.
enum class ServiceEnd : std::uint8_t {
  never,
  /// It ends when every campaign is finished or cancelled, no file of the directory waits to be
  /// served, and clients that follow a campaign have had the time to learn that it is over.
  when_done,
};

/// What a coordinator's operator may want to be told about a campaign: it is finished, or failed.
struct CampaignNotice {
  std::string campaign;        ///< Name.
  std::filesystem::path file;  ///< Its database.
  /// Why it failed: it was cancelled by its own limit, its storage failed, two computations of a
  /// run differ, or most of its runs were given up. Empty if all runs are stored or given up and
  /// the statistics are in the file.
  std::string failure = {};
};

struct ServiceConfig {
  std::string workers_endpoint;  ///< Where workers connect; the port may be `*`.
  /// A socket that listens there already, for workers that are started before the service. The
  /// service takes it over.
  std::optional<int> workers_listener;
  std::optional<std::string> clients_endpoint;  ///< Where clients connect; none are served without.
  /// Directory with coordinator.key and the lists of authorized keys. Without it, every peer that
  /// reaches the addresses is served.
  std::optional<std::filesystem::path> keys;
  bool is_plain_waived = false;  ///< --insecure-plain: other machines may connect without keys.
  ServiceEnd end = ServiceEnd::never;
  GivenUpRuns given_up = GivenUpRuns::keep;
  Duration drain_max = std::chrono::seconds(120);  ///< Then a drain becomes a stop.
  /// Memory that the process may have, bytes. The sockets are closed and bound again before it is
  /// reached. Without it, all peers that can connect are trusted.
  std::optional<std::size_t> memory_size_max;
  CampaignFiles* files = nullptr;  ///< Outlives the service; null if nothing can be submitted.
  /// Its campaigns are served besides those that are handed over; null if there is none.
  const CampaignDirectory* directory = nullptr;
  /// With a directory: how many files of finished campaigns stay open. The others are closed, and
  /// opened again when somebody asks for more runs.
  std::size_t finished_open_max = 16;
  SubmissionLimits limits;  ///< Hold for each client's key.
  /// The program `proofmass`, whose commands answer questions about results; empty if there is
  /// none. Its output is kept in the directory, which is made when it is needed.
  std::filesystem::path answer_program;
  std::filesystem::path answer_directory;
  Duration answer_duration_max = std::chrono::seconds(120);  ///< A copy may take thirty times that.
  /// Told of the ends and failures of campaigns while it serves them, each once; may be empty. A
  /// service that ends when all is done tells of the end of each campaign first.
  std::function<void(const CampaignNotice&)> on_notice;
  std::string version;  ///< Of the program, for people.
  DispatchConfig dispatch;
  WriterConfig writer;
  /// Descriptors that the process needs for something else than workers, clients and files.
  std::uint64_t num_descriptors_reserved = 0;
};

/// What the parts of a service have in common. They keep references to it: it outlives them.
struct ServiceContext {
  const ServiceConfig& config;
  CoordinatorStart start;
  State& state;
  StoreWriter& writer;
  Background& background;
  Outbox& outbox;
  Log log;  ///< Alone, of what concerns no campaign that is served: no database gets the event.
  std::function<TimePoint()> now;
};

/// Threads of a service, to be required before it is made: ZeroMQ's, and those that write, answer,
/// guard and wait.
inline constexpr int num_service_threads = 8;

/// A coordinator: lends the runs of its campaigns to the workers that connect, stores their results
/// and answers clients. One thread serves all sockets; another writes to the campaign databases.
class Service {
 public:
  /// Binds the sockets and begins to serve the campaigns, and those of the directory. A file of the
  /// directory that cannot be served is tried again later.
  ///
  /// @throws InvalidArgument if an endpoint is not acceptable; Error if it cannot be bound, keys
  ///         cannot be read, or two campaigns that are handed over have one name; StoreError.
  Service(std::vector<ServedCampaign> campaigns, const ServiceConfig& config, Log log);
  ~Service();

  /// The addresses to connect to, with the ports that were chosen.
  [[nodiscard]] std::string workers_endpoint() const;
  [[nodiscard]] std::string clients_endpoint() const;  ///< Empty if there are no clients.

  /// Serves until it ends by itself or is asked to; then workers have been told to end, and all
  /// that was delivered is stored, if it can be.
  ///
  /// @param on_turn  Called many times a second; may call the other functions, may throw.
  void run(const std::atomic<StopRequest>& stop, const std::function<void()>& on_turn);

  /// The campaigns, in the order in which they came.
  [[nodiscard]] std::vector<proto::CampaignStatus> campaigns() const;
  /// Everything about it now, for other threads. To be called in its own thread.
  [[nodiscard]] ServiceSnapshot snapshot() const;
  /// True if every campaign is finished or cancelled, and no file waits to be served.
  [[nodiscard]] bool is_done() const;
  /// True if results were delivered and could not be stored, or a campaign cannot store any. To be
  /// asked after run().
  [[nodiscard]] bool has_storage_failed() const;

  /// Number of the worker with this process on this machine; nothing if it is not registered.
  [[nodiscard]] std::optional<WorkerId> worker_of(std::uint64_t process_id) const;
  /// What its dispatch knows.
  [[nodiscard]] const State& state() const;

  /// The worker's process is known to have ended: its runs are lent again at once.
  void worker_ended(WorkerId worker, LossReason reason);

  /// Ends the service of all campaigns and gives the files that are open back. The last call.
  [[nodiscard]] std::vector<ServedCampaign> close();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace proofmass::coordinator
