// How campaigns end: who is told of it, when their files are closed, and how they are archived.

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <exception>
#include <utility>

#include "coordinator/dispatch/campaigns.hpp"
#include "coordinator/net/campaign_service.hpp"
#include "coordinator/net/outcome.hpp"
#include "coordinator/store/campaign_peek.hpp"
#include "core/error.hpp"
#include "proto/wire/names.hpp"

namespace proofmass::coordinator {
namespace {

std::string not_at_rest(std::string_view campaign) {
  return fmt::format("campaign = {} (its database is being read or changed; try again)", campaign);
}

}  // namespace

void CampaignService::review_notices(CampaignId id, Served& served) {
  const CampaignState& campaign = state_.campaigns.at(id);
  if (phase_of(id) == Phase::active) served.is_end_told = false;
  if (!served.is_end_told && is_finished_and_settled(id, served)) {
    served.is_end_told = true;
    const bool has_failed = wire::has_failed(status_of_served(id));
    tell(served, has_failed ? CampaignNotice::Kind::failed : CampaignNotice::Kind::finished,
         has_failed ? "most of its runs were given up" : "");
  }
  const bool has_failed = !campaign.storage_failure.empty();
  if (has_failed && !served.is_storage_failure_told) {
    tell(served, CampaignNotice::Kind::failed, campaign.storage_failure);
  }
  served.is_storage_failure_told = has_failed;
  if (campaign.num_mismatches > served.num_mismatches_told) {
    tell(served, CampaignNotice::Kind::failed,
         fmt::format("{} runs were computed again with another result", campaign.num_mismatches));
  }
  served.num_mismatches_told = campaign.num_mismatches;
}

void CampaignService::tell(const Served& served, CampaignNotice::Kind kind,
                           std::string reason) const {
  if (!context_.config.on_notice) return;
  context_.config.on_notice(
      {.kind = kind, .campaign = served.name, .file = served.file, .reason = std::move(reason)});
}

bool CampaignService::is_settled(CampaignId id, const Served& served) const {
  const CampaignState& campaign = state_.campaigns.at(id);
  const bool has_statistics = !served.is_summary_due && !served.summary.valid();
  const bool is_quiet =
      campaign.delivered.empty() && campaign.num_comparing == 0 && campaign.storage_failure.empty();
  return has_statistics && is_quiet && !served.is_held && served.written.phase == phase_of(id);
}

bool CampaignService::is_finished_and_settled(CampaignId id, const Served& served) const {
  return is_settled(id, served) && phase_of(id) == Phase::finished &&
         is_finished(state_.campaigns.at(id));
}

// A file that is open can be copied if somebody removes it. So the last ones stay open.
void CampaignService::close_surplus(std::vector<CampaignId> ended, TimePoint now) {
  const std::size_t count_max = context_.config.finished_open_max;
  // Without a directory, a file that was closed could not be opened again.
  if (context_.config.directory == nullptr || ended.size() <= count_max) return;
  const auto ended_at = [this](CampaignId id) { return served_.at(id).ended_at; };
  std::ranges::stable_sort(ended, {}, ended_at);
  ended.resize(ended.size() - count_max);
  for (const CampaignId id : ended) {
    const std::optional<TimePoint> tried_at = served_.at(id).closing_at;
    if (!tried_at || now - *tried_at >= context_.config.writer.retry_after) {
      begin_closing(id, [](bool) {});
    }
  }
}

void CampaignService::review_rest(CampaignId id, Served& served) {
  const CampaignState& campaign = state_.campaigns.at(id);
  const bool is_quiet = campaign.lent.empty() && campaign.audits.empty() &&
                        campaign.delivered.empty() && campaign.num_comparing == 0;
  const bool is_at_rest = is_quiet && phase_of(id) != Phase::active && !served.is_summary_due &&
                          !served.summary.valid() && !served.is_held;
  if (is_at_rest && !served.is_at_rest) writer_.rest(id);
  served.is_at_rest = is_at_rest;
}

// Nobody must be reading an old state of the file: then it is closed later.
void CampaignService::begin_closing(CampaignId id, std::function<void(bool is_closing)> then) {
  served_.at(id).is_held = true;
  context_.background.post_next([this, id, then = std::move(then)]() -> Background::Finish {
    bool is_folded = false;
    try {
      writer_.access(id, [&](Store& store) { is_folded = !store.rest(); });
    } catch (const std::exception&) {
      // The writer says why it cannot write.
    }
    return [this, id, is_folded, then] {
      Served& served = served_.at(id);
      served.is_held = false;
      served.closing_at = context_.now();
      bool is_closing = is_folded && is_settled(id, served) && has_ended(phase_of(id));
      try {
        if (is_closing) close_ended(id);
      } catch (const std::exception& error) {
        say_not_closed(error.what());
        is_closing = false;
      }
      then(is_closing);
    };
  });
}

// The dispatch forgets the campaign first: nothing is written any more when the file is closed.
void CampaignService::close_ended(CampaignId id) {
  const std::filesystem::path file = served_.at(id).file;
  EndedCampaign ended{.id = id, .file = file, .status = status_of_served(id), .stamp = {}};
  ended.status.rate_hz = 0.0;
  ended.status.remaining_s.reset();
  history_.note_closed(id);
  on_removed(state_, id, outbox_);
  on_ended(state_, id, ended.status.num_runs);
  served_.erase(id);
  ended_.emplace(id, std::move(ended));
  context_.background.post_next([this, id, file,
                                 epoch = context_.start.epoch]() -> Background::Finish {
    std::optional<std::string> reason;
    try {
      Store store = writer_.close(id);
      std::vector<coordinator::Entry> entries;
      for (const SessionId session : store.attached_sessions()) {
        entries.emplace_back(WorkerEnded{.session = session, .reason = LossReason::drained});
      }
      if (!entries.empty()) (void)store.write(entries);
      store.end_coordinator(epoch);
      reason = store.rest();
    } catch (const std::exception& error) {
      reason = error.what();
    }
    // The stamp of no file has a file looked at again, which serves one whose log is still needed.
    const std::optional<FileStamp> stamp = reason ? FileStamp{} : stamp_of(file);
    return [this, id, stamp, reason] {
      const auto found = ended_.find(id);
      if (found == ended_.end()) return;
      found->second.stamp = stamp;
      if (reason) return say_not_closed(*reason);
      outbox_.log({.kind = "campaign_closed", .fields = {{"campaign", found->second.status.name}}});
    };
  });
}

void CampaignService::archive(CampaignId id, const Respond& respond) {
  if (context_.config.directory == nullptr) {
    throw Error(
        "this coordinator has no directory, which archived campaigns need; start it with "
        "--directory");
  }
  const auto found = served_.find(id);
  if (found == served_.end()) return move_to_archive(id, respond);
  if (!is_settled(id, found->second)) {
    throw Error(fmt::format("campaign = {} (something is still to be stored; try again)",
                            found->second.name));
  }
  begin_closing(id, [this, id, respond, name = found->second.name](bool is_closing) {
    if (is_closing) return move_to_archive(id, respond);
    respond(wire::error_reply(not_at_rest(name)));
  });
}

// What closes the file was posted before.
void CampaignService::move_to_archive(CampaignId id, const Respond& respond) {
  const EndedCampaign& campaign = ended_.at(id);
  context_.background.post_next([this, id, respond, file = campaign.file,
                                 name = campaign.status.name]() -> Background::Finish {
    std::filesystem::path place;
    std::string failure;
    try {
      // A log that is left behind has results, and nobody could use the name again.
      if (has_journal(file)) throw Error(not_at_rest(name));
      place = context_.config.directory->archive(file);
    } catch (const std::exception& error) {
      failure = error.what();
    }
    return [this, id, respond, place, failure, name] {
      if (!failure.empty()) return respond(wire::error_reply(failure));
      respond(outcome_of([&] {
        note_archived(id, name, place);
        return wire::done_reply(
            fmt::format("campaign {}: its database is {} now", name, place.string()));
      }));
    };
  });
}

void CampaignService::note_archived(CampaignId id, const std::string& name,
                                    const std::filesystem::path& place) {
  // Looking at the directory may have found out before that the file is gone.
  if (ended_.erase(id) > 0) {
    std::erase(order_, id);
    on_unlisted(state_, id);
  }
  outbox_.log(
      {.kind = "campaign_archived", .fields = {{"campaign", name}, {"file", place.string()}}});
}

void CampaignService::say_not_closed(std::string_view reason) {
  outbox_.log({.severity = Severity::warning,
               .kind = "campaign_not_closed",
               .fields = {Field::reason(reason)}});
}

bool CampaignService::is_all_done() const {
  return std::all_of(state_.campaigns.begin(), state_.campaigns.end(), [&](const auto& item) {
    const auto& [id, campaign] = item;
    return campaign.phase == Phase::cancelled || (is_finished(campaign) && !is_undecided(id)) ||
           served_.at(id).is_abandoned;
  });
}

bool CampaignService::is_all_told() const {
  if (!context_.config.on_notice) return true;
  return std::ranges::all_of(served_, [&](const auto& item) {
    const auto& [id, served] = item;
    return phase_of(id) != Phase::finished || served.is_end_told ||
           !served.summary_failure.empty() || !state_.campaigns.at(id).storage_failure.empty();
  });
}

std::vector<ServedCampaign> CampaignService::close() {
  std::vector<ServedCampaign> campaigns;
  for (const CampaignId id : order_) {
    if (!served_.contains(id)) continue;
    Served& served = served_.at(id);
    if (served.summary.valid()) served.summary.wait();
    Store store = writer_.close(id);
    try {
      store.end_coordinator(context_.start.epoch);
    } catch (const std::exception& error) {
      say_not_closed(error.what());
    }
    const CampaignState& campaign = state_.campaigns.at(id);
    campaigns.push_back(
        {.file = served.file, .store = std::move(store), .definition = campaign.definition});
  }
  served_.clear();
  return campaigns;
}

}  // namespace proofmass::coordinator
