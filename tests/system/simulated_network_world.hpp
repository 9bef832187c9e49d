#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "tests/system/simulated_network_coordinator.hpp"
#include "tests/system/simulated_network_execution.hpp"
#include "tests/system/simulated_network_time.hpp"
#include "worker/net/conversation.hpp"

namespace proofmass::test {

constexpr wire::CampaignId urgent{11};
constexpr wire::CampaignId other{7};
constexpr double never_s = 1e9;

/// How bad a world is; drawn from its seed. Times are mean times between events.
struct Weather {
  double loss = 0.0;        ///< Probability that a message is lost.
  double repetition = 0.0;  ///< Probability that it arrives twice.
  double delay_s_max = 0.0;
  double death_s = 0.0;     ///< Of a worker's process.
  double cut_s = 0.0;       ///< Of its connection.
  double stall_s = 0.0;     ///< Of the whole process: it is stopped, and goes on later.
  double leave_s = 0.0;     ///< It is asked to end.
  double restart_s = 0.0;   ///< Of the coordinator.
  double blackout_s = 0.0;  ///< Of all connections.
  double failure_s = 0.0;   ///< Of the storage of a campaign.
  double pause_s = 0.0;
  double cancel_s = 0.0;
  double copy_s = 0.0;           ///< Somebody copies a campaign's file.
  double name_s = 0.0;           ///< A file loses its name for a while.
  double thread_stall_s = 0.0;   ///< Of the coordinator's service thread.
  double lie_s = 0.0;            ///< Somebody says of an honest host that it crashed.
  double extension_s = 0.0;      ///< Somebody asks for more runs of a campaign.
  double shut = 0.0;             ///< Probability that a file cannot be opened at a start.
  double restored = 0.0;         ///< Probability that a coordinator starts with an older copy.
  bool is_stubborn = false;      ///< The later campaign's file opens once the other is finished.
  bool is_full = false;          ///< The coordinator takes no more workers than there are machines.
  bool has_spools = false;       ///< Results survive a worker's process.
  bool has_bad_machine = false;  ///< One on which every batch crashes.
  bool has_accident = false;     ///< One crash for no reason of ours.
  bool has_liar = false;         ///< With a valid key; it lies for ever.
  bool has_one_key = false;      ///< The liar has that of the others.
};

/// What happened in a world, so that a test can tell that worlds are bad enough.
struct Incidents {
  std::uint64_t num_deaths = 0;
  std::uint64_t num_crashes = 0;
  std::uint64_t num_restarts = 0;
  std::uint64_t num_given_up = 0;
  std::uint64_t num_compared = 0;
  std::uint64_t num_spooled = 0;  ///< Results that a process took over from the one before it.
  std::uint64_t num_lies = 0;
  std::uint64_t num_released = 0;  ///< Hosts from quarantine.
};

/// A coordinator and its workers under a simulated network and clock. Dispatch and conversation are
/// the real ones; only what computes, what stores and what supervises is played.
class World {
 public:
  explicit World(std::uint64_t seed);

  /// Until all campaigns are finished; fails the test if that takes for ever.
  void run();
  /// Fails the test if anything was lost, repeated or left.
  void check_end();

  [[nodiscard]] const Incidents& incidents() const { return incidents_; }
  [[nodiscard]] const PlayedCoordinator& coordinator() const { return coordinator_; }

 private:
  /// A computer with a supervisor that starts a worker's process again when it has ended.
  struct Machine {
    std::string host;
    std::size_t num_threads = 1;
    std::size_t num_lanes = 1;
    std::uint32_t num_card_slots = 0;
    bool can_cards_compute = true;  ///< Else processors compute what is for cards.
    bool is_bad = false;
    std::map<RunKey, wire::LeasedResult> spool;
  };
  struct Process {
    std::size_t machine = 0;
    std::unique_ptr<PlayedExecution> execution;
    std::unique_ptr<worker::Conversation> conversation;
    TimePoint cut_until{};
    TimePoint stalled_until{};
    bool is_heeded = false;      ///< Somebody has seen that its host is quarantined.
    std::set<RunKey> unspooled;  ///< Results without an acknowledgement at the last look.
    TimePoint spooled_at{};
  };

  void draw_weather();
  void draw_troubles();
  void add_campaigns();
  void add_poison(wire::CampaignId id, std::uint64_t num_runs);
  void plan();
  void plan_campaign(wire::CampaignId id);
  void plan_troubles(wire::CampaignId id);
  /// Makes it happen again and again, until the weather is calm.
  void repeat(double mean_s, const std::function<void()>& what);
  /// The same while a process lives.
  void repeat_for(wire::SessionId session, double mean_s,
                  const std::function<void(Process&)>& what);
  [[nodiscard]] bool is_calm() const;
  [[nodiscard]] Process* find(wire::SessionId session);

  void start_process(std::size_t machine, std::optional<proto::FormerSession> former);
  void plan_process(wire::SessionId session);
  void tick_process(wire::SessionId session);
  void compute(wire::SessionId session);
  void crash(wire::SessionId session);
  void replace(wire::SessionId session);
  void end_if_over(wire::SessionId session);

  void transmit(wire::SessionId session, const std::function<void()>& arrive);
  void arrive(const proto::Envelope& message);
  void receive(Process& process, const proto::Envelope& message);
  void tick_coordinator();
  void restart_coordinator();
  void start_coordinator();
  [[nodiscard]] bool is_over() const;

  // Troubles with files, threads and liars.
  void open_later(wire::CampaignId id);
  void end_troubles();
  void lie();
  void say_as_liar(wire::SessionId session, proto::Envelope message);
  void lie_for_ever();
  void heed_quarantine(wire::SessionId session);
  void spool(Process& process);

  Randomness random_;
  Weather weather_;
  Agenda agenda_;
  Poison poison_;
  Draws draws_;
  std::optional<Liar> liar_;
  PlayedCoordinator coordinator_;
  std::vector<Machine> machines_;
  std::map<wire::SessionId, Process> processes_;
  TimePoint blackout_until_{};
  std::uint64_t next_host_ = 0;
  std::map<wire::CampaignId, std::uint64_t> num_runs_wanted_;
  std::uint64_t num_liar_messages_ = 0;
  Incidents incidents_;
};

}  // namespace proofmass::test
