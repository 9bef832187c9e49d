#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "coordinator/dispatch/dispatch.hpp"
#include "tests/system/simulated_network_execution.hpp"
#include "tests/system/simulated_network_time.hpp"

namespace proofmass::test {

/// What outlives a coordinator of one campaign.
struct PlayedFile {
  coordinator::StoredCampaign stored;  ///< As it began; the rest is what has changed since.
  coordinator::Phase phase = coordinator::Phase::active;
  std::map<RunIndex, int> num_commits;
  std::set<RunIndex> given_up;
  std::set<RunIndex> compared;
  std::set<RunIndex> audits_given_up;
  std::map<RunIndex, coordinator::StoredCampaign::Blamed> blamed;
  bool is_failing = false;  ///< Nothing can be stored for now.
};

/// The real dispatch, with what surrounds it played: it can be killed and started again.
class PlayedCoordinator final : public coordinator::Outbox {
 public:
  using Send = std::function<void(const wire::Packet&)>;

  PlayedCoordinator(Agenda& agenda, Randomness& random, Send send);

  void add_file(wire::CampaignId id, const coordinator::StoredCampaign& stored);
  /// @pre It does not run.
  void start();
  void kill();
  void receive(const wire::Packet& packet);
  void tick();

  void pause_or_resume(wire::CampaignId id);
  void cancel_or_resume(wire::CampaignId id);
  void fail_storage(wire::CampaignId id);
  void recover_storage(wire::CampaignId id);
  /// Ends all that people have done.
  void resume_all();

  [[nodiscard]] bool is_running() const { return life_.has_value(); }
  [[nodiscard]] bool is_done() const;
  /// @pre It runs.
  [[nodiscard]] const coordinator::State& state() const { return life_->state; }
  [[nodiscard]] const std::map<wire::CampaignId, PlayedFile>& files() const { return files_; }
  [[nodiscard]] std::uint32_t attempt_max() const { return attempt_max_; }
  [[nodiscard]] const std::map<std::string, std::uint64_t>& num_events() const {
    return num_events_;
  }

  // Outbox.
  void send(wire::WorkerId worker, wire::Message message) override;
  void send_definition(wire::WorkerId worker, const wire::CampaignRequest& request,
                       const std::shared_ptr<const Campaign>& definition) override;
  void store(coordinator::Arrival arrival) override;
  void compare(coordinator::Arrival arrival) override;
  void record(const coordinator::Loss& loss) override;
  void give_up(wire::CampaignId campaign, RunIndex run) override;
  void log(coordinator::Event event) override;

 private:
  struct Peer {
    wire::SessionId session;
    std::uint64_t num_sent = 0;
    bool said_hello = false;
  };
  /// What ends with the process.
  struct Life {
    wire::Epoch epoch;
    coordinator::State state;
    std::map<wire::SessionId, wire::WorkerId> workers;
    std::map<wire::WorkerId, Peer> peers;
    std::map<wire::CampaignId, std::deque<std::function<void(PlayedFile&)>>> writes;
  };

  wire::WorkerId meet(wire::SessionId session);
  void handle(wire::WorkerId worker, const wire::Packet& packet);
  void check_sent(wire::WorkerId worker, const wire::Message& message) const;
  void after_event();
  /// Does it later and in order, unless the process has ended by then; a failing file waits.
  void write_later(wire::CampaignId id, std::function<void(PlayedFile&)> write);
  void flush(wire::CampaignId id);

  Agenda& agenda_;
  Randomness& random_;
  Send send_;
  std::map<wire::CampaignId, PlayedFile> files_;
  std::set<wire::SessionId> attached_;
  std::optional<Life> life_;
  std::uint32_t attempt_max_ = 0;
  std::map<std::string, std::uint64_t> num_events_;
};

}  // namespace proofmass::test
