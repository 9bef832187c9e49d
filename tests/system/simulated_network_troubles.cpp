#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "core/microscope/simulation/run.hpp"
#include "tests/support/messages.hpp"
#include "tests/system/simulated_network_world.hpp"

// Troubles beyond the network: files that cannot be opened, lose their names or come back as older
// copies, a service thread that stalls, hosts that lie, workers that leave results to others.

namespace proofmass::test {

using namespace std::chrono_literals;

void World::draw_troubles() {
  const auto sometimes = [&](double probability, double min_s, double max_s) {
    return random_.happens(probability) ? min_s + random_.uniform(max_s - min_s) : never_s;
  };
  weather_.thread_stall_s = sometimes(0.25, 20.0, 100.0);
  weather_.lie_s = sometimes(0.2, 1.0, 10.0);
  // These need a coordinator that restarts while its workers have results at hand.
  const bool has_old_copies = random_.happens(0.35);
  const bool has_shut_files = random_.happens(0.35);
  if (has_old_copies || has_shut_files) weather_.restart_s = 5.0 + random_.uniform(25.0);
  weather_.copy_s = has_old_copies ? 2.0 + random_.uniform(10.0) : never_s;
  weather_.name_s = has_old_copies ? sometimes(0.5, 10.0, 40.0) : never_s;
  weather_.extension_s = has_old_copies ? sometimes(0.7, 5.0, 20.0) : never_s;
  weather_.restored = has_old_copies ? 0.3 + random_.uniform(0.6) : 0.0;
  weather_.shut = has_shut_files ? 0.2 + random_.uniform(0.5) : 0.0;
  weather_.is_stubborn = random_.happens(0.1);
  weather_.is_full = random_.happens(0.15);
  weather_.has_spools = random_.happens(0.5);
  weather_.has_liar = random_.happens(0.3);
  weather_.has_one_key = random_.happens(0.5);
  if (weather_.has_liar) {
    weather_.is_full = false;  // It would take the place of the others.
    // With a second bad host they look like poison.
    weather_.has_bad_machine = false;
    weather_.has_accident = false;
  }
  if (weather_.is_stubborn) {
    // Workers have results of it when it is shut, and leave them to the next process.
    weather_.restart_s = 5.0 + random_.uniform(15.0);
    weather_.has_spools = true;
  }
  if (weather_.lie_s >= never_s) return;
  // Only then is it known that every crash was a lie.
  weather_.has_bad_machine = false;
  weather_.has_accident = false;
  weather_.is_full = false;  // Liars would take the place of the others.
  coordinator_.expect_no_crashes();
}

void World::plan_troubles(wire::CampaignId id) {
  repeat(weather_.copy_s, [this, id] {
    // Some forget to make other copies, and are left with an old one.
    if (!coordinator_.has_copy(id) || random_.happens(0.1)) coordinator_.copy_file(id);
  });
  repeat(weather_.name_s, [this, id] {
    if (!coordinator_.is_running()) return;
    coordinator_.lose_name(id);
    agenda_.add(random_.duration(40.0), [this, id] { coordinator_.recover_storage(id); });
  });
  repeat(weather_.extension_s, [this, id] { coordinator_.extend(id, num_runs_wanted_.at(id)); });
}

void World::start_coordinator() {
  for (const wire::CampaignId id : {urgent, other}) {
    if (!is_calm() && random_.happens(weather_.restored)) coordinator_.restore_copy(id);
    const bool is_stubborn = weather_.is_stubborn && id == other && incidents_.num_restarts > 0 &&
                             !coordinator_.files().at(id).is_complete();
    if (!is_stubborn && (is_calm() || !random_.happens(weather_.shut))) continue;
    coordinator_.shut(id);
    if (!is_stubborn) open_later(id);
  }
  coordinator_.start();
}

void World::open_later(wire::CampaignId id) {
  agenda_.add(random_.duration(60.0), [this, id] { coordinator_.open(id); });
}

/// Files can be opened again, and all runs are asked for.
void World::end_troubles() {
  if (!coordinator_.is_running()) return;
  for (const wire::CampaignId id : {urgent, other}) {
    coordinator_.extend(id, num_runs_wanted_.at(id));
    const bool is_stubborn = weather_.is_stubborn && id == other;
    if (!is_stubborn || coordinator_.is_done(urgent)) coordinator_.open(id);
  }
}

/// Somebody with another key speaks of an honest host.
void World::lie() {
  if (!coordinator_.is_running() || processes_.empty()) return;
  ++incidents_.num_lies;
  auto victim = processes_.begin();
  std::advance(victim, static_cast<std::ptrdiff_t>(random_.below(processes_.size())));
  const std::string host = machines_.at(victim->second.machine).host;
  const auto hello = [&](std::optional<wire::SessionId> former) {
    proto::Hello said = make_hello("liar", host, 1, model_version);
    if (former) *said.mutable_former() = make_former(*former);
    return in_envelope(said);
  };
  const wire::SessionId first{random_.number()};
  const wire::SessionId second{random_.number()};
  if (random_.happens(0.5)) {
    // A process that it has never been.
    return say_as_liar(first, hello(victim->first));
  }
  // A process of its own that has done nothing, or has taken some runs.
  say_as_liar(first, hello(std::nullopt));
  if (host == machines_.front().host && random_.happens(0.3)) {
    say_as_liar(first, in_envelope(make_heartbeat(2)));
  }
  say_as_liar(second, hello(first));
}

void World::say_as_liar(wire::SessionId session, proto::Envelope message) {
  message.set_session(session.value);
  message.set_epoch(message.has_hello() ? 0 : coordinator_.epoch().value);
  message.set_sequence(++num_liar_messages_);
  coordinator_.receive(
      message, {.key = weather_.has_one_key ? honest_key : liar_key, .address = liar_address});
}

/// Also when all else is calm: the campaigns must finish nevertheless.
void World::lie_for_ever() {
  if (!liar_) {
    liar_.emplace(draws_, poison_, random_,
                  [this](wire::SessionId session, proto::Envelope message) {
                    // What waits would be compared with what it is lent later.
                    if (coordinator_.is_running() && !coordinator_.is_stalled()) {
                      say_as_liar(session, std::move(message));
                    }
                  });
  }
  std::vector<wire::SessionId> honest;
  std::vector<std::string> hosts;
  for (const auto& [session, process] : processes_) honest.push_back(session);
  for (const Machine& machine : machines_) hosts.push_back(machine.host);
  for (std::uint64_t i = random_.below(4); i > 0; --i) liar_->speak(honest, hosts);
  ++incidents_.num_lies;
  agenda_.add(100ms + random_.duration(2.0), [this] { lie_for_ever(); });
}

/// Somebody sees that the workers of a host are refused: exchanges it, or has it released.
void World::heed_quarantine(wire::SessionId session) {
  Process* const process = find(session);
  if (process == nullptr) return;
  process->is_heeded = false;
  Machine& machine = machines_.at(process->machine);
  machine.is_bad = false;  // It is repaired, or exchanged.
  if (random_.happens(0.5)) {
    if (coordinator_.release_host(machine.host)) ++incidents_.num_released;
    return;
  }
  machine.host = fmt::format("h{}", next_host_++);
  replace(session);
}

/// As the worker's program does it: what has waited for two looks is written; the file is emptied
/// when nothing waits any more.
void World::spool(Process& process) {
  if (agenda_.now() - process.spooled_at < 5s) return;
  process.spooled_at = agenda_.now();
  auto& spool = machines_.at(process.machine).spool;
  const std::vector<wire::LeasedResult> results = process.conversation->unacknowledged().all();
  if (results.empty()) spool.clear();
  std::set<RunKey> seen;
  for (const wire::LeasedResult& result : results) {
    const RunKey run{result.campaign, result.computed.result.run};
    seen.insert(run);
    if (process.unspooled.contains(run)) spool[run] = result;
  }
  process.unspooled = std::move(seen);
}

}  // namespace proofmass::test
