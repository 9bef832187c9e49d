#include "tests/system/simulated_network_coordinator.hpp"

#include <cstdio>

#include "core/microscope/definition/campaign_definition.hpp"
#include "core/runs.hpp"
#include "proto/wire/names.hpp"
#include "tests/coordinator/dispatch/invariants.hpp"
#include "tests/support/messages.hpp"
#include "tests/test.hpp"

namespace proofmass::test {
namespace {

using coordinator::Phase;

coordinator::DispatchConfig quick_config() {
  coordinator::DispatchConfig config;
  config.heartbeat_interval = 4s;
  config.suspect_after = 12s;
  config.lost_after = 30s;
  config.arrival_max = 8s;
  config.hung_after_min = 20s;
  config.reattach_wait = 10s;
  config.lease_duration_max = 40s;
  config.lone_witness_wait = 2min;
  config.quarantine_duration = 2min;
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
  stored.control.phase = file.phase;
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
  coordinator::DispatchConfig config = quick_config();
  config.num_workers_max = num_workers_max_;
  life_->state = coordinator::initial_state(config, attached_, agenda_.now());
  for (const auto& [id, file] : files_) {
    if (file.is_shut) {
      ++num_events_["file_not_opened"];
    } else if (file.phase == Phase::finished && file.is_complete() && random_.happens(0.5)) {
      ++num_events_["finished_file_left_out"];
      on_ended(life_->state, id, file.num_runs());
    } else {
      serve(id);
    }
  }
  after_event();
}

void PlayedCoordinator::serve(wire::CampaignId id) {
  const PlayedFile& file = files_.at(id);
  on_campaign(life_->state, id, found_in(file), agenda_.now(), *this);
  if (file.is_failing) on_store_failed(life_->state, id, "no space", *this);
}

void PlayedCoordinator::kill() {
  attached_.clear();
  for (const auto& [id, worker] : life_->state.workers) attached_.insert(worker.session);
  life_.reset();
  for (auto& [id, file] : files_) {
    if (file.is_nameless) restore_copy(id);
  }
}

void PlayedCoordinator::receive(const proto::Envelope& message, const coordinator::HostId& from) {
  if (!life_) return;
  if (is_stalled()) {
    life_->waiting.emplace_back(message, from);
    return;
  }
  ASSERT_TRUE(wire::is_of_worker(message));
  const wire::WorkerId worker = meet({message.session()}, from);
  if (message.has_hello()) life_->peers.at(worker).said_hello = true;
  if (message.epoch() != life_->epoch.value && !message.has_hello()) {
    coordinator::reject_unregistered(worker, *this);
  } else {
    on_message(life_->state, worker, from, message, agenda_.now(), *this);
    check_adoptions(worker);
  }
  after_event();
}

void PlayedCoordinator::stall(Duration duration) {
  if (!life_ || is_stalled()) return;
  ++num_events_["service_stalled"];
  life_->stalled_until = agenda_.now() + duration;
  agenda_.add(duration, [this, epoch = life_->epoch] {
    if (life_ && life_->epoch == epoch) go_on();
  });
}

/// All that was sent meanwhile arrives at once.
void PlayedCoordinator::go_on() {
  life_->stalled_until = TimePoint{};
  if (random_.happens(0.3)) tick();
  for (const auto& [message, from] : std::exchange(life_->waiting, {})) {
    ++num_events_["message_waited"];
    receive(message, from);
  }
  for (const auto& [id, file] : files_) flush(id);
}

void PlayedCoordinator::tick() {
  if (!life_ || is_stalled()) return;
  on_tick(life_->state, agenda_.now(), *this);
  after_event();
}

void PlayedCoordinator::pause_or_resume(wire::CampaignId id) {
  if (!is_served(id)) return;
  if (life_->state.campaigns.at(id).phase == Phase::active) {
    on_pause(life_->state, id, *this);
  } else {
    on_resume(life_->state, id, agenda_.now(), *this);
  }
  after_event();
}

void PlayedCoordinator::cancel_or_resume(wire::CampaignId id) {
  if (!is_served(id)) return;
  if (life_->state.campaigns.at(id).phase == Phase::cancelled) {
    on_resume(life_->state, id, agenda_.now(), *this);
  } else {
    on_cancel(life_->state, id, *this);
  }
  after_event();
}

void PlayedCoordinator::resume_all() {
  for (const auto& [id, file] : files_) {
    if (is_served(id)) on_resume(life_->state, id, agenda_.now(), *this);
  }
  if (life_) after_event();
}

void PlayedCoordinator::extend(wire::CampaignId id, std::uint64_t num_runs) {
  PlayedFile& file = files_.at(id);
  if (!life_ || is_stalled() || file.is_shut || file.is_failing || file.num_runs() >= num_runs) {
    return;
  }
  ++num_events_["campaign_extended"];
  if (!life_->state.campaigns.contains(id)) serve(id);  // It was finished, and left out.
  std::unique_ptr<Campaign> extended = file.stored.definition->clone();
  extended->num_runs = num_runs;
  file.stored.definition = std::move(extended);
  on_extended(life_->state, id, file.stored.definition, agenda_.now(), *this);
  after_event();
}

bool PlayedCoordinator::release_host(const std::string& host) {
  if (!life_ || is_stalled()) return false;
  const bool is_released = on_release_host(life_->state, host, agenda_.now(), *this);
  after_event();
  return is_released;
}

void PlayedCoordinator::fail_storage(wire::CampaignId id) {
  files_.at(id).is_failing = true;
  if (is_served(id)) on_store_failed(life_->state, id, "no space", *this);
}

void PlayedCoordinator::recover_storage(wire::CampaignId id) {
  PlayedFile& file = files_.at(id);
  file.is_failing = false;
  file.is_nameless = false;
  if (!life_ || !life_->state.campaigns.contains(id)) return;
  on_store_recovered(life_->state, id, agenda_.now(), *this);
  flush(id);
}

void PlayedCoordinator::copy_file(wire::CampaignId id) {
  if (files_.at(id).is_failing) return;
  copies_[id] = files_.at(id);
}

void PlayedCoordinator::lose_name(wire::CampaignId id) {
  if (!is_served(id) || !copies_.contains(id)) return;
  ++num_events_["name_lost"];
  files_.at(id).is_nameless = true;
  fail_storage(id);
}

void PlayedCoordinator::restore_copy(wire::CampaignId id) {
  const auto copy = copies_.find(id);
  if (copy == copies_.end()) return;
  PlayedFile& file = files_.at(id);
  if (copy->second.num_commits.size() < file.num_commits.size()) {
    ++num_events_["results_lost_with_a_file"];
  }
  if (copy->second.num_runs() < file.num_runs()) ++num_events_["extension_lost_with_a_file"];
  const bool is_shut = file.is_shut;
  file = copy->second;
  file.is_shut = is_shut;
}

void PlayedCoordinator::open(wire::CampaignId id) {
  PlayedFile& file = files_.at(id);
  if (!file.is_shut) return;
  if (life_ && is_stalled()) {
    return agenda_.add(life_->stalled_until - agenda_.now() + 1ms, [this, id] { open(id); });
  }
  file.is_shut = false;
  if (!life_) return;
  ++num_events_["file_opened_late"];
  serve(id);
  after_event();
}

bool PlayedCoordinator::is_stalled() const { return agenda_.now() < life_->stalled_until; }

bool PlayedCoordinator::is_served(wire::CampaignId id) const {
  return life_ && !is_stalled() && life_->state.campaigns.contains(id);
}

bool PlayedCoordinator::is_done(wire::CampaignId id) const {
  if (!life_) return false;
  const auto campaign = life_->state.campaigns.find(id);
  if (campaign == life_->state.campaigns.end()) return life_->state.ended.contains(id);
  return campaign->second.phase == Phase::finished && is_finished(campaign->second);
}

bool PlayedCoordinator::is_done() const {
  return std::all_of(files_.begin(), files_.end(),
                     [&](const auto& item) { return is_done(item.first); });
}

wire::WorkerId PlayedCoordinator::meet(wire::SessionId session, const coordinator::HostId& from) {
  const auto [found, is_new] = life_->workers.try_emplace(session);
  if (is_new) {
    found->second = {life_->workers.size()};
    life_->peers[found->second] = {.session = session, .is_honest = from.address != liar_address};
  }
  return found->second;
}

void PlayedCoordinator::after_event() {
  check_invariants(life_->state);
  for (const auto& [id, campaign] : life_->state.campaigns) files_.at(id).phase = campaign.phase;
}

void PlayedCoordinator::send(wire::WorkerId worker, proto::Envelope message) {
  check_sent(worker, message);
  Peer& peer = life_->peers.at(worker);
  if (message.has_run_lease()) {
    const proto::RunLease& lease = message.run_lease();
    attempt_max_ = std::max(attempt_max_, lease.attempt());
    for (const RunIndex run : indices_of(std::array{wire::runs_of(lease)})) {
      lent_[peer.session].insert({{lease.campaign()}, run});
    }
  }
  if (message.has_not_served()) {
    const bool is_of_all = message.not_served().ranges().empty();
    ++num_events_[is_of_all ? "campaign_not_served" : "runs_not_served"];
  }
  message.set_session(peer.session.value);
  message.set_epoch(life_->epoch.value);
  message.set_sequence(++peer.num_sent);
  send_(message);
}

void PlayedCoordinator::send_definition(wire::WorkerId worker, wire::CampaignId campaign,
                                        std::uint64_t offset,
                                        const std::shared_ptr<const Campaign>& definition) {
  ++num_events_["definition_sent"];
  auto known = definitions_.find(definition.get());
  if (known == definitions_.end()) {
    const wire::EncodedDefinition encoded(definition->definition(TableColumns::left_out));
    known = definitions_.emplace(definition.get(), std::pair(definition, encoded)).first;
  }
  send(worker, in_envelope(known->second.second.part(campaign, offset)));
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
  if (file.is_failing || is_stalled()) return;
  for (const auto& write : std::exchange(life_->writes[id], {})) write(file);
  after_event();
}

void PlayedCoordinator::write(wire::CampaignId campaign, coordinator::Entry entry) {
  std::visit([&](const auto& kind) { store(campaign, kind); }, entry);
}

void PlayedCoordinator::store(wire::CampaignId id, const coordinator::Delivery& delivery) {
  const RunIndex run = delivery.result.run;
  EXPECT_EQ(delivery.result.truth, files_.at(id).stored.definition->draw(run).truth)
      << "a forged result is stored";
  write_later(id, [this, id, run](PlayedFile& file) {
    ++file.num_commits[run];
    file.given_up.erase(run);
    on_committed(life_->state, id, std::vector{run}, agenda_.now(), *this);
  });
}

void PlayedCoordinator::store(wire::CampaignId id, const coordinator::SecondDelivery& second) {
  const RunIndex run = second.delivery.result.run;
  write_later(id, [this, id, run](PlayedFile& file) {
    EXPECT_TRUE(file.num_commits.contains(run)) << "compared with nothing";
    file.compared.insert(run);
    on_compared(life_->state, id, run, {}, true, agenda_.now(), *this);
  });
}

void PlayedCoordinator::store(wire::CampaignId campaign, const coordinator::ReturnedRuns& loss) {
  ++num_events_[std::string(wire::name_of(loss.reason))];
  const bool is_of_a_crash = coordinator::is_blamed(loss.reason);
  const bool is_honest = life_->peers.at(life_->workers.at(loss.worker)).is_honest;
  EXPECT_TRUE(may_crash_ || !is_of_a_crash || !is_honest) << "a liar has ended an honest worker";
  if (!loss.is_blamed) return;
  write_later(campaign, [loss](PlayedFile& file) {
    for (RunIndex run = loss.runs.first; run.value < loss.runs.end(); ++run.value) {
      auto& blamed = file.blamed[run];
      blamed.run = run;
      ++blamed.num_crashes;
      blamed.attempt = std::max(blamed.attempt, loss.attempt);
    }
  });
}

void PlayedCoordinator::store(wire::CampaignId campaign, const coordinator::GivenUpRun& given_up) {
  write_later(campaign, [run = given_up.run](PlayedFile& file) {
    if (!file.num_commits.contains(run)) file.given_up.insert(run);
  });
}

void PlayedCoordinator::log(coordinator::Event event, wire::CampaignId campaign) {
  ++num_events_[std::string(event.kind)];
  const std::string text = to_text(event);
  if (std::getenv("PROOFMASS_SEED") != nullptr) {  // A world is replayed.
    const double now_s = std::chrono::duration<double>(agenda_.now().time_since_epoch()).count();
    std::printf("%9.3f %s\n", now_s, text.c_str());
  }
  if (event.kind == "host_quarantined" && !may_crash_) {
    EXPECT_NE(text.find("address=" + liar_address), std::string::npos) << text;
  }
  if (event.kind == "audit_given_up") {
    ASSERT_EQ(event.fields.at(0).name, "run");
    const auto run = std::get<std::uint64_t>(event.fields.at(0).value);
    files_.at(campaign).audits_given_up.insert({run});
  }
}

}  // namespace proofmass::test
