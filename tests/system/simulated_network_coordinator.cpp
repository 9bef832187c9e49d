#include "tests/system/simulated_network_coordinator.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <utility>
#include <variant>

#include "proto/wire/definition_codec.hpp"

namespace proofmass::test {
namespace {

using namespace std::chrono_literals;
using coordinator::Phase;

coordinator::DispatchConfig quick_config() {
  coordinator::DispatchConfig config;
  config.heartbeat_interval = 4s;
  config.suspect_after = 12s;
  config.lost_after = 30s;
  config.arrival_max = 8s;
  config.hung_after_min = 20s;
  config.reattach_wait = 10s;
  return config;
}

template <typename Runs>
std::vector<RunRange> ranges_of(const Runs& runs) {
  coordinator::RunSet set;
  for (const RunIndex run : runs) set.add({run, 1});
  return set.ranges();
}

/// What a coordinator finds when it starts.
coordinator::StoredCampaign found_in(const PlayedFile& file) {
  coordinator::StoredCampaign stored = file.stored;
  stored.phase = file.phase;
  std::vector<RunIndex> committed;
  for (const auto& [run, count] : file.num_commits) committed.push_back(run);
  stored.finished = ranges_of(committed);
  stored.given_up = ranges_of(file.given_up);
  stored.compared = ranges_of(file.compared);
  for (const RunRange& range : ranges_of(file.audits_given_up)) stored.compared.push_back(range);
  for (const auto& [run, blamed] : file.blamed) stored.blamed.push_back(blamed);
  return stored;
}

}  // namespace

PlayedCoordinator::PlayedCoordinator(Agenda& agenda, Randomness& random, Send send)
    : agenda_(agenda), random_(random), send_(std::move(send)) {}

void PlayedCoordinator::add_file(wire::CampaignId id, const coordinator::StoredCampaign& stored) {
  files_[id].stored = stored;
}

void PlayedCoordinator::start() {
  life_.emplace();
  life_->epoch = {random_.number()};
  life_->state = coordinator::initial_state(quick_config(), attached_, agenda_.now());
  for (auto& [id, file] : files_) {
    on_campaign(life_->state, id, found_in(file), agenda_.now(), *this);
    if (file.is_failing) on_store_failed(life_->state, id, "no space", *this);
  }
  after_event();
}

void PlayedCoordinator::kill() {
  attached_.clear();
  for (const auto& [id, worker] : life_->state.workers) attached_.insert(worker.session);
  life_.reset();
}

void PlayedCoordinator::receive(const wire::Packet& packet) {
  if (!life_) return;
  const wire::WorkerId worker = meet(packet.header.session);
  const bool is_hello = std::holds_alternative<wire::Hello>(packet.message);
  if (is_hello) life_->peers.at(worker).said_hello = true;
  if (packet.header.epoch != life_->epoch && !is_hello) {
    coordinator::reject_unregistered(worker, *this);
  } else {
    handle(worker, packet);
  }
  after_event();
}

void PlayedCoordinator::handle(wire::WorkerId worker, const wire::Packet& packet) {
  coordinator::State& state = life_->state;
  const TimePoint now = agenda_.now();
  if (const auto* const hello = std::get_if<wire::Hello>(&packet.message)) {
    on_hello(state, worker, packet.header.session, "", *hello, now, *this);
  } else if (const auto* const heartbeat = std::get_if<wire::Heartbeat>(&packet.message)) {
    on_heartbeat(state, worker, *heartbeat, packet.header.sequence, now, *this);
  } else if (const auto* const results = std::get_if<wire::ResultBatch>(&packet.message)) {
    on_results(state, worker, *results, now, *this);
  } else if (const auto* const give_back = std::get_if<wire::GiveBack>(&packet.message)) {
    on_give_back(state, worker, *give_back, now, *this);
  } else if (const auto* const request = std::get_if<wire::CampaignRequest>(&packet.message)) {
    on_campaign_request(state, worker, *request, now, *this);
  } else if (const auto* const bye = std::get_if<wire::Bye>(&packet.message)) {
    on_bye(state, worker, *bye, now, *this);
  } else {
    ADD_FAILURE() << "a worker sent what only a coordinator sends";
  }
}

void PlayedCoordinator::tick() {
  if (!life_) return;
  on_tick(life_->state, agenda_.now(), *this);
  after_event();
}

void PlayedCoordinator::pause_or_resume(wire::CampaignId id) {
  if (!life_) return;
  if (life_->state.campaigns.at(id).phase == Phase::active) {
    on_pause(life_->state, id, *this);
  } else {
    on_resume(life_->state, id, agenda_.now(), *this);
  }
  after_event();
}

void PlayedCoordinator::cancel_or_resume(wire::CampaignId id) {
  if (!life_) return;
  if (life_->state.campaigns.at(id).phase == Phase::cancelled) {
    on_resume(life_->state, id, agenda_.now(), *this);
  } else {
    on_cancel(life_->state, id, *this);
  }
  after_event();
}

void PlayedCoordinator::resume_all() {
  if (!life_) return;
  for (const auto& [id, file] : files_) on_resume(life_->state, id, agenda_.now(), *this);
  after_event();
}

void PlayedCoordinator::fail_storage(wire::CampaignId id) {
  files_.at(id).is_failing = true;
  if (life_) on_store_failed(life_->state, id, "no space", *this);
}

void PlayedCoordinator::recover_storage(wire::CampaignId id) {
  files_.at(id).is_failing = false;
  if (!life_) return;
  on_store_recovered(life_->state, id, agenda_.now(), *this);
  flush(id);
}

bool PlayedCoordinator::is_done() const {
  if (!life_) return false;
  for (const auto& [id, campaign] : life_->state.campaigns) {
    if (campaign.phase != Phase::finished || !is_finished(campaign)) return false;
  }
  return true;
}

wire::WorkerId PlayedCoordinator::meet(wire::SessionId session) {
  const auto [found, is_new] = life_->workers.try_emplace(session);
  if (is_new) {
    found->second = {life_->workers.size()};
    life_->peers[found->second].session = session;
  }
  return found->second;
}

void PlayedCoordinator::after_event() {
  check_invariants(life_->state);
  for (auto& [id, file] : files_) file.phase = life_->state.campaigns.at(id).phase;
}

void PlayedCoordinator::check_sent(wire::WorkerId worker, const wire::Message& message) const {
  const auto peer = life_->peers.find(worker);
  ASSERT_TRUE(peer != life_->peers.end()) << "sent to a peer that has said nothing";
  if (!std::holds_alternative<wire::Reject>(message)) {
    EXPECT_TRUE(peer->second.said_hello) << "sent to a peer that has not said Hello";
  }
  if (const auto* const ack = std::get_if<wire::ResultAck>(&message)) {
    for (const RunIndex run : ack->runs) {
      EXPECT_TRUE(files_.at(ack->campaign).num_commits.contains(run))
          << "acknowledged before the commit";
    }
  }
  const auto* const lease = std::get_if<wire::RunLease>(&message);
  if (lease == nullptr) return;
  const PlayedFile& file = files_.at(lease->campaign);
  for (RunIndex run = lease->runs.first; run.value < lease->runs.end(); ++run.value) {
    EXPECT_TRUE(
        !file.num_commits.contains(run) ||
        coordinator::is_audited(file.stored.definition->seed, run, file.stored.audit_fraction))
        << "what was finished is computed again";
  }
}

void PlayedCoordinator::send(wire::WorkerId worker, wire::Message message) {
  check_sent(worker, message);
  if (const auto* const lease = std::get_if<wire::RunLease>(&message)) {
    attempt_max_ = std::max(attempt_max_, lease->attempt.value);
  }
  Peer& peer = life_->peers.at(worker);
  send_({.header = {.session = peer.session, .epoch = life_->epoch, .sequence = ++peer.num_sent},
         .message = std::move(message)});
}

void PlayedCoordinator::send_definition(wire::WorkerId worker, const wire::CampaignRequest& request,
                                        const std::shared_ptr<const Campaign>& definition) {
  send(worker, wire::EncodedDefinition(*definition).part(request));
}

void PlayedCoordinator::write_later(wire::CampaignId id, std::function<void(PlayedFile&)> write) {
  auto& writes = life_->writes[id];
  writes.push_back(std::move(write));
  if (writes.size() > 1) return;  // A commit of the group is on its way.
  agenda_.add(random_.duration(0.1), [this, id, epoch = life_->epoch] {
    if (life_ && life_->epoch == epoch) flush(id);
  });
}

void PlayedCoordinator::flush(wire::CampaignId id) {
  PlayedFile& file = files_.at(id);
  if (file.is_failing) return;
  for (const auto& write : std::exchange(life_->writes[id], {})) write(file);
  after_event();
}

void PlayedCoordinator::store(coordinator::Arrival arrival) {
  const RunIndex run = arrival.computed.result.run;
  write_later(arrival.campaign, [this, id = arrival.campaign, run](PlayedFile& file) {
    ++file.num_commits[run];
    file.given_up.erase(run);
    on_committed(life_->state, id, std::vector{run}, agenda_.now(), *this);
  });
}

void PlayedCoordinator::compare(coordinator::Arrival arrival) {
  const RunIndex run = arrival.computed.result.run;
  write_later(arrival.campaign,
              [this, id = arrival.campaign, worker = arrival.worker, run](PlayedFile& file) {
                EXPECT_TRUE(file.num_commits.contains(run)) << "compared with nothing";
                file.compared.insert(run);
                on_compared(life_->state, id, run, worker, true, agenda_.now(), *this);
              });
}

void PlayedCoordinator::record(const coordinator::Loss& loss) {
  ++num_events_[std::string(coordinator::name_of(loss.reason))];
  if (!loss.is_blamed) return;
  write_later(loss.campaign, [loss](PlayedFile& file) {
    for (RunIndex run = loss.runs.first; run.value < loss.runs.end(); ++run.value) {
      auto& blamed = file.blamed[run];
      blamed.run = run;
      ++blamed.num_crashes;
      blamed.attempt = std::max(blamed.attempt, loss.attempt);
    }
  });
}

void PlayedCoordinator::give_up(wire::CampaignId campaign, RunIndex run) {
  write_later(campaign, [run](PlayedFile& file) {
    if (!file.num_commits.contains(run)) file.given_up.insert(run);
  });
}

void PlayedCoordinator::log(coordinator::Event event) {
  ++num_events_[std::string(event.kind)];
  if (std::getenv("PROOFMASS_SEED") != nullptr) {  // A world is replayed.
    const double now_s = std::chrono::duration<double>(agenda_.now().time_since_epoch()).count();
    std::printf("%9.3f %.*s %s\n", now_s, static_cast<int>(event.kind.size()), event.kind.data(),
                event.text.c_str());
  }
  if (event.kind == "audit_given_up") {
    unsigned long long run = 0;
    ASSERT_EQ(std::sscanf(event.text.c_str(), "run=%llu", &run), 1);
    files_.at(event.campaign).audits_given_up.insert({run});
  }
}

}  // namespace proofmass::test
