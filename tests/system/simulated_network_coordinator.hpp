#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "coordinator/dispatch/events.hpp"
#include "proto/wire/definition_codec.hpp"
#include "tests/system/simulated_network_execution.hpp"
#include "tests/system/simulated_network_liar.hpp"
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
  std::map<RunIndex, coordinator::BlamedRun> blamed;
  bool is_failing = false;  ///< Nothing can be stored for now.
  /// It has lost its name: if the coordinator ends before that is mended, what is left is the copy.
  bool is_nameless = false;
  bool is_shut = false;  ///< It cannot be opened for now.

  [[nodiscard]] std::uint64_t num_runs() const { return stored.definition->num_runs; }
  /// Every run is committed or given up.
  [[nodiscard]] bool is_complete() const {
    return num_commits.size() + given_up.size() == num_runs();
  }
};

/// The keys of those who speak to the coordinator.
inline const std::string honest_key = "honest";
inline const std::string liar_key = "liar";

/// The real dispatch, with what surrounds it played: it can be killed and started again, its files
/// can be missing or older than they were, and the thread that serves it can stall.
class PlayedCoordinator final : public coordinator::Outbox {
 public:
  using Send = std::function<void(const proto::Envelope&)>;

  PlayedCoordinator(Agenda& agenda, Randomness& random, Send send);

  void add_file(wire::CampaignId id, const coordinator::StoredCampaign& stored);
  void set_num_workers_max(std::size_t count) { num_workers_max_ = count; }
  /// From now on nothing that happens to an honest worker may count as a crash.
  void expect_no_crashes() { may_crash_ = false; }

  /// @pre It does not run.
  void start();
  void kill();
  void receive(const proto::Envelope& message, const coordinator::HostId& from);
  void tick();
  /// Its thread does nothing for so long; what is sent to it waits.
  void stall(Duration duration);

  void pause_or_resume(wire::CampaignId id);
  void cancel_or_resume(wire::CampaignId id);
  void fail_storage(wire::CampaignId id);
  void recover_storage(wire::CampaignId id);
  /// Ends all that people have done.
  void resume_all();
  /// Somebody asks for so many runs.
  void extend(wire::CampaignId id, std::uint64_t num_runs);
  bool release_host(const std::string& host);

  /// Somebody copies the file.
  void copy_file(wire::CampaignId id);
  [[nodiscard]] bool has_copy(wire::CampaignId id) const { return copies_.contains(id); }
  /// The file loses its name, if there is a copy of it to fall back to.
  void lose_name(wire::CampaignId id);
  /// Puts the copy in the place of the file, if there is one. @pre It does not run.
  void restore_copy(wire::CampaignId id);
  /// The file cannot be opened. @pre It does not run.
  void shut(wire::CampaignId id) { files_.at(id).is_shut = true; }
  /// It can, and is if the coordinator runs.
  void open(wire::CampaignId id);

  [[nodiscard]] bool is_running() const { return life_.has_value(); }
  [[nodiscard]] bool is_stalled() const;
  [[nodiscard]] bool is_served(wire::CampaignId id) const;
  [[nodiscard]] bool is_done(wire::CampaignId id) const;
  [[nodiscard]] bool is_done() const;
  /// @pre It runs.
  [[nodiscard]] const coordinator::State& state() const { return life_->state; }
  [[nodiscard]] wire::Epoch epoch() const { return life_->epoch; }
  [[nodiscard]] const std::map<wire::CampaignId, PlayedFile>& files() const { return files_; }
  [[nodiscard]] std::uint32_t attempt_max() const { return attempt_max_; }
  [[nodiscard]] const std::map<std::string, std::uint64_t>& num_events() const {
    return num_events_;
  }

  // Outbox.
  void send(wire::WorkerId worker, proto::Envelope message) override;
  void send_definition(wire::WorkerId worker, wire::CampaignId campaign, std::uint64_t offset,
                       const std::shared_ptr<const Campaign>& definition) override;
  void write(wire::CampaignId campaign, coordinator::Entry entry) override;
  void log(coordinator::Event event, wire::CampaignId campaign) override;

 private:
  struct Peer {
    wire::SessionId session;
    bool is_honest = true;
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
    TimePoint stalled_until{};
    /// And whence they came.
    std::deque<std::pair<proto::Envelope, coordinator::HostId>> waiting;
  };

  wire::WorkerId meet(wire::SessionId session, const coordinator::HostId& from);
  void serve(wire::CampaignId id);
  void go_on();
  // Kinds of entries that are looked at.
  void store(wire::CampaignId campaign, const coordinator::Delivery& delivery);
  void store(wire::CampaignId campaign, const coordinator::SecondDelivery& second);
  void store(wire::CampaignId campaign, const coordinator::ReturnedRuns& loss);
  void store(wire::CampaignId campaign, const coordinator::GivenUpRun& given_up);
  template <typename Other>
  void store(wire::CampaignId, const Other&) {}
  void check_sent(wire::WorkerId worker, const proto::Envelope& message) const;
  void check_lease(const proto::RunLease& lease) const;
  void check_forget(const proto::Forget& forget) const;
  void check_not_served(const proto::NotServed& not_served) const;
  void check_reject(const proto::Reject& reject, const Peer& peer) const;
  void check_adoptions(wire::WorkerId worker) const;
  void after_event();
  /// Does it later and in order, unless the process has ended by then; a failing file waits.
  void write_later(wire::CampaignId id, std::function<void(PlayedFile&)> write);
  void flush(wire::CampaignId id);

  Agenda& agenda_;
  Randomness& random_;
  Send send_;
  std::map<wire::CampaignId, PlayedFile> files_;
  std::map<wire::CampaignId, PlayedFile> copies_;  ///< Older than the files.
  std::size_t num_workers_max_ = 4096;
  bool may_crash_ = true;
  std::set<wire::SessionId> attached_;
  std::map<wire::SessionId, std::set<RunKey>> lent_;  ///< By all coordinators.
  std::optional<Life> life_;
  /// As it was encoded last: a campaign has one definition for long.
  std::map<const Campaign*, std::pair<std::shared_ptr<const Campaign>, wire::EncodedDefinition>>
      definitions_;
  std::uint32_t attempt_max_ = 0;
  std::map<std::string, std::uint64_t> num_events_;
};

}  // namespace proofmass::test
