#include "tests/system/simulated_network_world.hpp"

#include <fmt/format.h>

#include "core/microscope/simulation/run.hpp"
#include "tests/support/messages.hpp"
#include "tests/test.hpp"

namespace proofmass::test {
namespace {

constexpr Duration deadline = 2h;  // Of simulated time.

}  // namespace

World::World(std::uint64_t seed)
    : random_(seed), coordinator_(agenda_, random_, [this](const proto::Envelope& message) {
        const wire::SessionId session{message.session()};
        if (liar_ && liar_->has(session)) return liar_->hear(message);
        transmit(session, [this, message] { arrive(message); });
      }) {
  draw_weather();
  draw_troubles();
  add_campaigns();
  const std::size_t num_machines = 2 + random_.below(3);
  if (weather_.is_full) coordinator_.set_num_workers_max(num_machines);
  for (std::size_t i = 0; i < num_machines; ++i) {
    machines_.push_back({.host = fmt::format("h{}", next_host_++),
                         .num_threads = 1 + random_.below(2),
                         .num_lanes = 1 + random_.below(4),
                         .num_card_slots = random_.happens(0.3) ? 20U : 0U,
                         .can_cards_compute = random_.happens(0.7),
                         .is_bad = weather_.has_bad_machine && i == 0,
                         .spool = {}});
    agenda_.add(random_.duration(3.0), [this, i] { start_process(i, std::nullopt); });
  }
  start_coordinator();
  tick_coordinator();
  plan();
  if (weather_.has_liar) lie_for_ever();
}

void World::draw_weather() {
  const auto sometimes = [&](double probability, double min_s, double max_s) {
    return random_.happens(probability) ? min_s + random_.uniform(max_s - min_s) : never_s;
  };
  weather_ = {.loss = random_.happens(0.7) ? random_.uniform(0.25) : 0.0,
              .repetition = random_.happens(0.6) ? random_.uniform(0.2) : 0.0,
              .delay_s_max = random_.uniform(2.5),
              .death_s = sometimes(0.5, 20.0, 100.0),
              .cut_s = sometimes(0.4, 20.0, 100.0),
              .stall_s = sometimes(0.3, 20.0, 100.0),
              .leave_s = sometimes(0.3, 20.0, 100.0),
              .restart_s = sometimes(0.5, 20.0, 150.0),
              .blackout_s = sometimes(0.3, 30.0, 150.0),
              .failure_s = sometimes(0.3, 20.0, 100.0),
              .pause_s = sometimes(0.3, 10.0, 60.0),
              .cancel_s = sometimes(0.15, 20.0, 100.0),
              .has_bad_machine = random_.happens(0.3),
              .has_accident = random_.happens(0.3)};
  if (weather_.has_bad_machine) weather_.has_accident = false;  // Together they look like poison.
}

void World::add_campaigns() {
  for (const auto& [id, num_runs, priority] :
       {std::tuple(other, 24U, 0), std::tuple(urgent, 12U, 5)}) {
    MicroscopeCampaign campaign;
    campaign.num_runs = num_runs;
    campaign.seed = random_.number();
    coordinator::StoredCampaign stored{
        .definition = std::make_shared<const MicroscopeCampaign>(campaign),
        .control = {.priority = priority}};
    constexpr std::array fractions{0.0, 0.0, 0.3, 1.0};
    stored.control.audit_fraction = fractions.at(random_.below(fractions.size()));
    coordinator_.add_file(id, stored);
    num_runs_wanted_[id] = weather_.extension_s < never_s ? num_runs + 12 : num_runs;
    campaign.num_runs = num_runs_wanted_[id];
    for (RunIndex run; run.value < campaign.num_runs; ++run.value) {
      draws_[{id, run}] = campaign.draw(run);
    }
    if (weather_.lie_s >= never_s) add_poison(id, num_runs_wanted_[id]);
  }
}

void World::add_poison(wire::CampaignId id, std::uint64_t num_runs) {
  while (random_.happens(0.2)) poison_.crashing.insert({id, {random_.below(num_runs)}});
  while (random_.happens(0.1)) poison_.crashing_outside.insert({id, {random_.below(num_runs)}});
  while (random_.happens(0.1)) poison_.hanging.insert({id, {random_.below(num_runs)}});
}

void World::plan() {
  repeat(weather_.restart_s, [this] { restart_coordinator(); });
  repeat(weather_.blackout_s, [this] { blackout_until_ = agenda_.now() + random_.duration(50.0); });
  repeat(weather_.thread_stall_s, [this] {
    if (coordinator_.is_running()) coordinator_.stall(random_.duration(30.0));
  });
  repeat(weather_.lie_s, [this] { lie(); });
  for (const wire::CampaignId id : {urgent, other}) {
    plan_campaign(id);
    plan_troubles(id);
  }
}

void World::plan_campaign(wire::CampaignId id) {
  repeat(weather_.pause_s, [this, id] { coordinator_.pause_or_resume(id); });
  repeat(weather_.cancel_s, [this, id] { coordinator_.cancel_or_resume(id); });
  repeat(weather_.failure_s, [this, id] {
    coordinator_.fail_storage(id);
    agenda_.add(random_.duration(40.0), [this, id] { coordinator_.recover_storage(id); });
  });
}

void World::repeat(double mean_s, const std::function<void()>& what) {
  if (mean_s >= never_s) return;
  agenda_.add(random_.duration(2.0 * mean_s), [this, mean_s, what] {
    if (is_calm()) return;
    what();
    repeat(mean_s, what);
  });
}

void World::repeat_for(wire::SessionId session, double mean_s,
                       const std::function<void(Process&)>& what) {
  if (mean_s >= never_s) return;
  agenda_.add(random_.duration(2.0 * mean_s), [this, session, mean_s, what] {
    Process* const process = find(session);
    if (process == nullptr || is_calm()) return;
    what(*process);
    repeat_for(session, mean_s, what);
  });
}

/// From some time on nothing bad happens, but for poison: a campaign must come to its end.
bool World::is_calm() const { return agenda_.now() - TimePoint{} >= 300s; }

World::Process* World::find(wire::SessionId session) {
  const auto found = processes_.find(session);
  return found == processes_.end() ? nullptr : &found->second;
}

void World::run() {
  while (!is_over() && agenda_.now() < TimePoint{} + deadline) agenda_.step();
  ASSERT_TRUE(is_over()) << "not finished in two hours";
}

bool World::is_over() const {
  return coordinator_.is_done() &&
         std::all_of(num_runs_wanted_.begin(), num_runs_wanted_.end(), [&](const auto& item) {
           return coordinator_.files().at(item.first).num_runs() == item.second;
         });
}

void World::check_end() {
  for (const auto& [id, file] : coordinator_.files()) {
    const Campaign& campaign = *file.stored.definition;
    for (RunIndex run; run.value < campaign.num_runs; ++run.value) {
      const auto commits = file.num_commits.find(run);
      const bool is_committed = commits != file.num_commits.end();
      EXPECT_NE(is_committed, poison_.has({id, run}))
          << "campaign " << id.value << " run " << run.value;
      if (!is_committed) {
        const auto served = coordinator_.state().campaigns.find(id);
        EXPECT_TRUE(served == coordinator_.state().campaigns.end()
                        ? file.given_up.contains(run)
                        : served->second.given_up.contains(run))
            << run.value;
        ++incidents_.num_given_up;
        continue;
      }
      EXPECT_EQ(commits->second, 1) << "campaign " << id.value << " run " << run.value;
      const bool is_to_be_audited =
          coordinator::is_audited(campaign.seed, run, file.stored.control.audit_fraction);
      EXPECT_TRUE(!is_to_be_audited || file.compared.contains(run) ||
                  file.audits_given_up.contains(run))
          << "not audited: campaign " << id.value << " run " << run.value;
    }
    incidents_.num_compared += file.compared.size();
  }
  EXPECT_TRUE(coordinator_.state().leases.empty());
}

// The network.

void World::transmit(wire::SessionId session, const std::function<void()>& arrive) {
  const Process* const process = find(session);
  const bool is_cut = process != nullptr && agenda_.now() < process->cut_until;
  if (is_cut || agenda_.now() < blackout_until_) return;
  const bool is_bad = !is_calm();
  if (!is_bad || !random_.happens(weather_.loss)) {
    agenda_.add(random_.duration(weather_.delay_s_max), arrive);
  }
  if (is_bad && random_.happens(weather_.repetition)) {
    agenda_.add(random_.duration(weather_.delay_s_max), arrive);
  }
}

void World::arrive(const proto::Envelope& message) {
  const wire::SessionId session{message.session()};
  Process* const process = find(session);
  if (process == nullptr) return;
  if (agenda_.now() < process->stalled_until) {
    agenda_.add(process->stalled_until - agenda_.now(), [this, message] { arrive(message); });
    return;
  }
  receive(*process, message);
  end_if_over(session);
}

/// A message takes no result from a worker but by an acknowledgement, or if it says that runs of
/// just these numbers are to be forgotten.
void World::receive(Process& process, const proto::Envelope& message) {
  worker::Conversation& conversation = *process.conversation;
  const proto::Forget& forget = message.forget();
  const auto num_kept = [&] {
    if (!message.has_forget()) return conversation.unacknowledged().size();
    std::size_t count = 0;
    for (const wire::LeasedResult& result : conversation.unacknowledged().all()) {
      const bool is_forgotten = result.campaign.value == forget.campaign() &&
                                result.computed.result.run.value < forget.num_runs();
      if (!is_forgotten) ++count;
    }
    return count;
  };
  const std::size_t num_before = num_kept();
  conversation.on_message(message, agenda_.now());
  if (!message.has_result_ack()) {
    EXPECT_EQ(num_kept(), num_before) << "results were thrown away";
  }
  const bool is_quarantined = message.reject().reason() == proto::REJECT_REASON_QUARANTINED;
  if (!is_quarantined || std::exchange(process.is_heeded, true)) return;
  agenda_.add(random_.duration(60.0),
              [this, session = wire::SessionId{message.session()}] { heed_quarantine(session); });
}

void World::tick_coordinator() {
  if (is_calm()) {
    if (!coordinator_.is_running()) start_coordinator();
    coordinator_.resume_all();
    end_troubles();
  }
  coordinator_.tick();
  agenda_.add(1s, [this] { tick_coordinator(); });
}

void World::restart_coordinator() {
  if (!coordinator_.is_running()) return;
  ++incidents_.num_restarts;
  coordinator_.kill();
  agenda_.add(random_.duration(20.0), [this] {
    if (!coordinator_.is_running()) start_coordinator();
  });
}

// Workers' processes.

void World::start_process(std::size_t machine, std::optional<proto::FormerSession> former) {
  const wire::SessionId session{random_.number()};
  const Machine& on = machines_.at(machine);
  const auto num_slots = static_cast<std::uint32_t>(on.num_threads * on.num_lanes);
  proto::Hello hello = make_hello("w", on.host, num_slots + on.num_card_slots, model_version);
  hello.set_num_card_slots(on.num_card_slots);
  if (former) *hello.mutable_former() = *former;
  worker::ConversationConfig config;
  config.hello_delay_max = 8s;
  config.refusal_delay = 5s;
  config.refusal_delay_max = 15s;
  config.resend_after_max = 20s;
  config.drain_time = 20s;
  Process& process = processes_[session];
  process.machine = machine;
  process.execution = std::make_unique<PlayedExecution>(
      poison_, draws_, on.num_threads, on.num_lanes, on.num_card_slots > 0 && on.can_cards_compute);
  const auto send = [this, machine](const proto::Envelope& message) {
    transmit({message.session()}, [this, message, host = machines_.at(machine).host] {
      coordinator_.receive(message, {.key = honest_key, .address = host});
    });
  };
  process.conversation = std::make_unique<worker::Conversation>(session, hello, *process.execution,
                                                                send, agenda_.now(), config);
  std::vector<wire::LeasedResult> spooled;
  for (const auto& [run, result] : on.spool) spooled.push_back(result);
  incidents_.num_spooled += spooled.size();
  process.conversation->restore(std::move(spooled));
  tick_process(session);
  compute(session);
  plan_process(session);
}

void World::plan_process(wire::SessionId session) {
  repeat_for(session, weather_.death_s, [this, session](Process&) {
    ++incidents_.num_deaths;
    replace(session);
  });
  repeat_for(session, weather_.cut_s, [this](Process& process) {
    process.cut_until = agenda_.now() + random_.duration(60.0);
  });
  repeat_for(session, weather_.stall_s, [this](Process& process) {
    process.stalled_until = agenda_.now() + random_.duration(60.0);
  });
  repeat_for(session, weather_.leave_s, [this, session](Process& process) {
    process.conversation->on_drain_request(agenda_.now());
    end_if_over(session);
  });
}

void World::tick_process(wire::SessionId session) {
  Process* const process = find(session);
  if (process == nullptr) return;
  if (agenda_.now() >= process->stalled_until) {
    process->conversation->on_tick(agenda_.now());
    if (weather_.has_spools) spool(*process);
    end_if_over(session);
  }
  agenda_.add(500ms, [this, session] { tick_process(session); });
}

void World::compute(wire::SessionId session) {
  Process* const process = find(session);
  if (process == nullptr) return;
  if (agenda_.now() >= process->stalled_until) {
    const bool is_bad = machines_.at(process->machine).is_bad;
    const auto outcome = process->execution->advance();
    const bool is_accident = weather_.has_accident && !is_calm() && random_.happens(0.02);
    if (outcome == PlayedExecution::Outcome::crashed ||
        (process->execution->is_computing() && (is_bad || is_accident))) {
      if (is_accident) weather_.has_accident = false;
      return crash(session);
    }
    if (outcome == PlayedExecution::Outcome::finished) {
      process->conversation->on_progress(agenda_.now());
      end_if_over(session);
    }
  }
  agenda_.add(50ms + random_.duration(1.0), [this, session] { compute(session); });
}

/// Mostly there is a supervisor that sees it and starts the next process at once.
void World::crash(wire::SessionId session) {
  ++incidents_.num_crashes;
  if (!random_.happens(0.9)) return replace(session);
  const std::size_t machine = processes_.at(session).machine;
  processes_.erase(session);
  const proto::FormerSession former = make_former(session);
  agenda_.add(random_.duration(3.0), [this, machine, former] { start_process(machine, former); });
}

void World::replace(wire::SessionId session) {
  const std::size_t machine = processes_.at(session).machine;
  processes_.erase(session);
  agenda_.add(random_.duration(10.0), [this, machine] { start_process(machine, std::nullopt); });
}

/// A worker that does nothing wrong ends only when it is asked to.
void World::end_if_over(wire::SessionId session) {
  Process& process = processes_.at(session);
  const auto ending = process.conversation->ending();
  if (!ending) return;
  EXPECT_EQ(ending->kind, worker::Ending::Kind::done) << ending->reason;
  if (weather_.has_spools) {
    for (const wire::LeasedResult& result : process.conversation->unacknowledged().all()) {
      machines_.at(process.machine).spool[{result.campaign, result.computed.result.run}] = result;
    }
  }
  replace(session);
}

}  // namespace proofmass::test
