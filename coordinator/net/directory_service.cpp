#include "coordinator/net/directory_service.hpp"

#include <algorithm>
#include <exception>
#include <memory>
#include <set>
#include <utility>
#include <variant>

namespace proofmass::coordinator {
namespace {

std::filesystem::path file_of(const FileOutcome& outcome) {
  if (const auto* const prepared = std::get_if<PreparedCampaign>(&outcome)) {
    return prepared->campaign.file;
  }
  if (const auto* const ended = std::get_if<EndedCampaign>(&outcome)) return ended->file;
  return std::get<FileFailure>(outcome).file;
}

}  // namespace

DirectoryService::Findings DirectoryService::look(const CampaignDirectory& directory,
                                                  KnownCampaigns known,
                                                  const std::vector<EndedFile>& ended,
                                                  const CoordinatorStart& start) {
  Findings findings;
  try {
    for (const EndedFile& one : ended) {
      if (!one.stamp || stamp_of(one.file) == one.stamp) continue;
      known.remove(one);
      findings.changed.push_back(one);
    }
    findings.outcomes = look_at_all(directory, known, start);
  } catch (const std::exception& error) {
    findings = {};
    findings.outcomes.emplace_back(FileFailure{.file = {}, .reason = error.what()});
  }
  return findings;
}

DirectoryService::DirectoryService(const ServiceContext& context, CampaignService& campaigns)
    : context_(context), campaigns_(campaigns) {}

void DirectoryService::take(FileOutcome outcome) {
  const std::filesystem::path file = file_of(outcome);
  try {
    if (auto* const failure = std::get_if<FileFailure>(&outcome)) return note(std::move(*failure));
    if (auto* const ended = std::get_if<EndedCampaign>(&outcome)) {
      campaigns_.list(std::move(*ended));
    } else {
      campaigns_.serve(std::get<PreparedCampaign>(std::move(outcome)));
    }
  } catch (const std::exception& error) {
    return note({.file = file, .reason = error.what()});
  }
  if (unserved_.erase(file) == 0) return;
  context_.outbox.log({.kind = "campaign_file_served", .fields = {{"file", file.string()}}});
}

void DirectoryService::note(FileFailure failure) {
  FileFailure& known = unserved_[failure.file];
  const bool is_news = known.reason != failure.reason;
  known = std::move(failure);
  if (!is_news) return;
  context_.outbox.log({.severity = Severity::error,
                       .kind = "campaign_not_served",
                       .fields = {Field::reason(known.reason)}});
}

void DirectoryService::review(TimePoint now) {
  const CampaignDirectory* const directory = context_.config.directory;
  if (directory == nullptr || is_looking_) return;
  if (now - looked_at_ < context_.config.writer.retry_after) return;
  is_looking_ = true;
  context_.background.post_next([this, directory, start = context_.start, now,
                                 known = campaigns_.known(),
                                 ended = campaigns_.ended_files()]() -> Background::Finish {
    const auto findings = std::make_shared<Findings>(look(*directory, known, ended, start));
    return [this, findings, now] { finish(std::move(*findings), now); };
  });
}

void DirectoryService::finish(Findings findings, TimePoint now) {
  is_looking_ = false;
  looked_at_ = now;
  std::set<std::filesystem::path> seen;
  for (const FileOutcome& outcome : findings.outcomes) seen.insert(file_of(outcome));
  for (const EndedFile& changed : findings.changed) unlist(changed, seen.contains(changed.file));
  const std::set<std::filesystem::path> served = campaigns_.known().files;
  for (FileOutcome& outcome : findings.outcomes) {
    const std::filesystem::path file = file_of(outcome);
    // It may have been submitted meanwhile.
    if (!served.contains(file)) take(std::move(outcome));
  }
  if (seen.contains(std::filesystem::path())) return;  // The directory could not be read.
  std::vector<std::filesystem::path> gone;
  for (const auto& [file, failure] : unserved_) {
    if (!seen.contains(file)) gone.push_back(file);
  }
  for (const std::filesystem::path& file : gone) forget(file);
}

void DirectoryService::unlist(const EndedFile& changed, bool is_there) {
  if (!campaigns_.unlist(changed) || is_there) return;
  context_.outbox.log({.severity = Severity::warning,
                       .kind = "campaign_file_gone",
                       .fields = {{"file", changed.file.string()}}});
}

void DirectoryService::forget(const std::filesystem::path& file) {
  unserved_.erase(file);
  const bool is_served = campaigns_.known().files.contains(file);
  context_.outbox.log({.kind = is_served ? "campaign_file_served" : "campaign_file_gone",
                       .fields = {{"file", file.string()}}});
}

bool DirectoryService::is_all_served() const {
  return std::all_of(unserved_.begin(), unserved_.end(),
                     [](const auto& item) { return item.second.is_copy; });
}

std::vector<wire::UnservedFile> DirectoryService::unserved(std::size_t count_max) const {
  std::vector<wire::UnservedFile> files;
  for (const auto& [file, failure] : unserved_) {
    if (files.size() == count_max) break;
    files.push_back({.file = file.string(), .reason = failure.reason});
  }
  return files;
}

}  // namespace proofmass::coordinator
