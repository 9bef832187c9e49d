// How the databases of campaigns go from state to state.

#include <fmt/format.h>

#include <algorithm>
#include <ranges>
#include <set>
#include <utility>

#include "coordinator/dispatch/events.hpp"
#include "coordinator/net/campaign_service.hpp"
#include "coordinator/store/campaign_record.hpp"
#include "core/error.hpp"
#include "proto/wire/names.hpp"

namespace proofmass::coordinator {
namespace {

std::string not_at_rest(std::string_view campaign) {
  return fmt::format("campaign = {} (its database is being read or changed; try again)", campaign);
}

}  // namespace

// Unserved, served and closed.

void CampaignService::add(FileLook look) {
  const CampaignRecord& campaign = look.record;
  const std::optional<CampaignRecord> same_name = find(campaign.status.name());
  const bool is_again =
      look.store && closed_.contains(campaign.id) && same_name && same_name->id == campaign.id;
  const bool is_there = same_name || served_.contains(campaign.id) || closed_.contains(campaign.id);
  if (is_there && !is_again) {
    throw Error(fmt::format("campaign = {} in {} (is served already, from another file)",
                            campaign.status.name(), campaign.file.string()));
  }
  if (!is_again) order_.push_back(campaign.id);
  if (look.store) return serve(std::move(look));
  on_ended(state_, campaign.id, campaign.status.num_runs());
  closed_.emplace(campaign.id, campaign);
}

namespace {

/// As of a campaign whose coordinator was killed before it had made them.
bool lacks_statistics(const FileLook& look) {
  const std::uint64_t num_finished = num_runs_in(look.stored.finished);
  if (!has_ended(look.stored.control.phase) || num_finished == 0) return false;
  const std::optional<Summary> summary = look.store->summary();
  return !summary || summary->num_finished != num_finished;
}

}  // namespace

void CampaignService::serve(FileLook look) {
  const CampaignId id = look.record.id;
  const TimePoint now = context_.now();
  const bool is_finished = look.stored.control.phase == Phase::finished;
  served_.emplace(id, Served{.record = std::move(look.record),
                             .rate = RateMeter(now),
                             .written = look.stored.control,
                             .plan = look.plan,
                             .is_decided = is_finished,
                             .num_failures_before = look.num_failures,
                             .is_end_told = is_finished,
                             .is_summary_due = lacks_statistics(look),
                             .summary = {}});
  closed_.erase(id);
  writer_.open(id, *std::move(look.store));
  on_campaign(state_, id, look.stored, now, outbox_);
  served_.at(id).summarised = counts_of(state_.campaigns.at(id));
}

void CampaignService::take(FileLook look) {
  const std::filesystem::path file = look.record.file;
  if (look.record.problem.empty()) {
    const std::string failure = failure_of([&] { add(std::move(look)); });
    if (failure.empty()) {
      if (unserved_.erase(file) == 0) return;
      return context_.log(Event::info("campaign_file_served", {{"file", file.string()}}));
    }
    look = {.record = {.file = file, .problem = failure}};
  }
  // It may be the copy from which the campaign is to go on, and is no file too many.
  const auto served = served_.find(look.record.id);
  if (look.is_copy && served != served_.end() && served->second.is_abandoned) {
    unserved_.erase(file);
    return;
  }
  const auto known = unserved_.find(file);
  const bool is_news =
      known == unserved_.end() || known->second.record.problem != look.record.problem;
  if (is_news) {
    context_.log(Event::error("campaign_not_served", {Field::reason(look.record.problem)}));
  }
  unserved_.insert_or_assign(file, std::move(look));
}

KnownCampaigns CampaignService::known() const {
  KnownCampaigns known;
  for (const auto& [id, served] : served_) known.add(served.record);
  for (const auto& [id, closed] : closed_) known.add(closed);
  return known;
}

void CampaignService::unlist(CampaignId id) {
  closed_.erase(id);
  std::erase(order_, id);
  on_unlisted(state_, id);
}

// The directory.

void CampaignService::review_directory() {
  const CampaignDirectory* const directory = context_.config.directory;
  const TimePoint now = context_.now();
  if (directory == nullptr || is_looking_) return;
  if (now - looked_at_ < context_.config.writer.retry_after) return;
  is_looking_ = true;
  std::vector<CampaignRecord> closed;
  for (const auto& [id, campaign] : closed_) closed.push_back(campaign);
  const auto look = [directory, start = context_.start, known = known(), closed = std::move(closed),
                     num_reserved = context_.config.num_descriptors_reserved]() mutable {
    Findings findings;
    for (const CampaignRecord& one : closed) {
      if (!one.stamp || stamp_of(one.file) == one.stamp) continue;
      known.remove(one);
      findings.changed.push_back(one);
    }
    findings.looks = look_at_all(*directory, known, start, num_reserved);
    return findings;
  };
  context_.background.post_next(work_of(look, [this, now](std::future<Findings> found) {
    is_looking_ = false;
    looked_at_ = now;
    Findings findings;
    const std::string failure = failure_of([&] { findings = found.get(); });
    // Without a file: that of the directory itself.
    if (!failure.empty()) findings.looks.emplace_back().record.problem = failure;
    take_findings(std::move(findings));
  }));
}

void CampaignService::take_findings(Findings findings) {
  std::set<std::filesystem::path> seen;
  for (const FileLook& look : findings.looks) seen.insert(look.record.file);
  const auto log_gone = [&](const std::filesystem::path& file, Severity severity) {
    context_.log(
        {.severity = severity, .kind = "campaign_file_gone", .fields = {{"file", file.string()}}});
  };
  for (const CampaignRecord& changed : findings.changed) {
    const auto found = closed_.find(changed.id);
    // It may have been looked at again since.
    if (found == closed_.end() || found->second.stamp != changed.stamp) continue;
    unlist(changed.id);
    if (!seen.contains(changed.file)) log_gone(changed.file, Severity::warning);
  }
  const std::set<std::filesystem::path> files = known().files;
  for (FileLook& look : findings.looks) {
    // It may have been submitted meanwhile.
    if (!files.contains(look.record.file)) take(std::move(look));
  }
  if (seen.contains(std::filesystem::path())) return;  // The directory could not be read.
  std::erase_if(unserved_, [&, files_now = known().files](const auto& item) {
    const std::filesystem::path& file = item.first;
    if (seen.contains(file)) return false;
    if (!files_now.contains(file)) {
      log_gone(file, Severity::info);
    } else {
      context_.log(Event::info("campaign_file_served", {{"file", file.string()}}));
    }
    return true;
  });
}

bool CampaignService::is_all_served() const {
  return std::ranges::all_of(unserved_, [](const auto& item) { return item.second.is_copy; }) &&
         std::ranges::all_of(closed_ | std::views::values, [](const CampaignRecord& campaign) {
           return has_ended(wire::phase_of(campaign.status));
         });
}

void CampaignService::add_unserved(proto::StatusReply& reply) const {
  reply.set_num_unserved_files(unserved_.size());
  for (const auto& [file, look] :
       unserved_ | std::views::take(wire::unserved_files_per_reply_max)) {
    proto::UnservedFile& unserved = *reply.add_unserved_files();
    unserved.set_file(file.string());
    unserved.set_reason(look.record.problem);
  }
}

// From served to closed.

bool CampaignService::expects_nothing(CampaignId id, const Served& served) const {
  const CampaignState& campaign = state_.campaigns.at(id);
  return campaign.delivered.empty() && campaign.num_comparing == 0 && !lacks_summary(id, served) &&
         !served.summary.valid() && !served.is_held;
}

bool CampaignService::is_settled(CampaignId id, const Served& served) const {
  const CampaignState& campaign = state_.campaigns.at(id);
  return expects_nothing(id, served) && campaign.storage_failure.empty() &&
         served.written.phase == phase_of(id);
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
  const bool is_at_rest = expects_nothing(id, served) && campaign.lent.empty() &&
                          campaign.audits.empty() && phase_of(id) != Phase::active;
  if (is_at_rest && !served.is_at_rest) writer_.rest(id);
  served.is_at_rest = is_at_rest;
}

// Nobody must be reading an old state of the file: then it is closed later.
void CampaignService::begin_closing(CampaignId id, std::function<void(bool is_closing)> then) {
  served_.at(id).is_held = true;
  const auto fold = [this, id] {
    bool is_folded = false;
    writer_.access(id, [&](Store& store) { is_folded = !store.rest(); });
    return is_folded;
  };
  context_.background.post_next(
      work_of(fold, [this, id, then = std::move(then)](std::future<bool> folded) {
        Served& served = served_.at(id);
        served.is_held = false;
        served.closing_at = context_.now();
        bool is_folded = false;
        // The writer says why it cannot write.
        (void)failure_of([&] { is_folded = folded.get(); });
        if (!is_folded || !is_settled(id, served) || !has_ended(phase_of(id))) return then(false);
        const std::string failure = failure_of([&] { close_ended(id); });
        if (!failure.empty()) say_not_closed(failure);
        then(failure.empty());
      }));
}

// The dispatch forgets the campaign first: nothing is written any more when the file is closed.
void CampaignService::close_ended(CampaignId id) {
  CampaignRecord closed = record_of(id);
  closed.is_closed = true;
  closed.num_waiting = 0;
  closed.status.set_rate_hz(0.0);
  closed.status.clear_remaining_s();
  const std::filesystem::path file = closed.file;
  on_removed(state_, id, outbox_);
  on_ended(state_, id, closed.status.num_runs());
  served_.erase(id);
  closed_.emplace(id, std::move(closed));
  const auto close = [this, id, file, epoch = context_.start.epoch] {
    {
      Store store = writer_.close(id);
      std::vector<Entry> entries;
      for (const SessionId session : store.attached_sessions()) {
        entries.emplace_back(WorkerEnded{.session = session, .reason = LossReason::drained});
      }
      if (!entries.empty()) (void)store.write(entries);
      store.end_coordinator(epoch);
      if (const std::optional<std::string> reason = store.rest()) throw Error(*reason);
    }  // Which may change the file.
    return stamp_of(file);
  };
  context_.background.post_next(
      work_of(close, [this, id](std::future<std::optional<FileStamp>> stamp) {
        const auto found = closed_.find(id);
        if (found == closed_.end()) return;
        // The stamp of no file has a file looked at again, which serves one whose log is still
        // needed.
        found->second.stamp = FileStamp{};
        const std::string failure = failure_of([&] { found->second.stamp = stamp.get(); });
        if (!failure.empty()) return say_not_closed(failure);
        context_.log(Event::info("campaign_closed", {{"campaign", found->second.status.name()}}));
      }));
}

std::set<CampaignId> CampaignService::abandoned() const {
  std::set<CampaignId> abandoned;
  for (const auto& [id, served] : served_) {
    if (served.is_abandoned) abandoned.insert(id);
  }
  return abandoned;
}

void CampaignService::archive(CampaignId id, const Respond& respond) {
  if (context_.config.directory == nullptr) {
    throw Error(
        "this coordinator has no directory, which archived campaigns need; start it with "
        "--directory");
  }
  const std::string file = record_of(id).file.stem().string();
  if (context_.config.directory->has_archived(file)) {
    throw Error(fmt::format("archived/{}.db is there already; rename that file first", file));
  }
  const auto found = served_.find(id);
  if (found == served_.end()) return move_to_archive(id, respond);
  // Says what became of the file and how to go on; there is nothing to be moved.
  if (found->second.is_abandoned) throw Error(state_.campaigns.at(id).storage_failure);
  if (!is_settled(id, found->second)) {
    throw Error(fmt::format("campaign = {} (something is still to be stored; try again)",
                            found->second.record.status.name()));
  }
  begin_closing(id,
                [this, id, respond, name = found->second.record.status.name()](bool is_closing) {
                  if (is_closing) return move_to_archive(id, respond);
                  respond(wire::error_reply(not_at_rest(name)));
                });
}

// What closes the file was posted before.
void CampaignService::move_to_archive(CampaignId id, const Respond& respond) {
  const CampaignRecord& campaign = closed_.at(id);
  const auto move = [this, file = campaign.file, name = campaign.status.name()] {
    // A log that is left behind has results, and nobody could use the name again.
    if (has_journal(file)) throw Error(not_at_rest(name));
    return context_.config.directory->archive(file);
  };
  context_.background.post_next(work_of(move, [this, id, respond, name = campaign.status.name()](
                                                  std::future<std::filesystem::path> moved) {
    respond_or_say_why(respond, [&] {
      const std::string place = moved.get().string();
      // Looking at the directory may have found out before that the file is gone.
      if (closed_.contains(id)) unlist(id);
      context_.log(Event::info("campaign_archived", {{"campaign", name}, {"file", place}}));
      respond(wire::done_reply(fmt::format("campaign {}: its database is {} now", name, place)));
    });
  }));
}

void CampaignService::say_not_closed(std::string_view reason) {
  context_.log(Event::warning("campaign_not_closed", {Field::reason(reason)}));
}

std::vector<ServedCampaign> CampaignService::close() {
  std::vector<ServedCampaign> campaigns;
  for (const CampaignId id : order_) {
    if (!served_.contains(id)) continue;
    Served& served = served_.at(id);
    if (served.summary.valid()) served.summary.wait();
    Store store = writer_.close(id);
    const std::string failure = failure_of([&] { store.end_coordinator(context_.start.epoch); });
    if (!failure.empty()) say_not_closed(failure);
    const CampaignState& campaign = state_.campaigns.at(id);
    campaigns.push_back(
        {.file = served.record.file, .store = std::move(store), .definition = campaign.definition});
  }
  served_.clear();
  return campaigns;
}

}  // namespace proofmass::coordinator
