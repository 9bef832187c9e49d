#include "coordinator/archive/listing.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <system_error>

#include "coordinator/archive/archive_error.hpp"
#include "coordinator/archive/campaign_mark.hpp"
#include "coordinator/store/store.hpp"
#include "core/runs.hpp"

namespace proofmass::coordinator {
namespace {

ListedCampaign listed(const std::filesystem::path& file) {
  try {
    const Store store = Store::open_read_only(file);
    return {.file = file,
            .problem = "",
            .name = store.name(),
            .seed = store.seed(),
            .num_runs = store.num_runs(),
            .num_finished = num_runs_in(store.finished_runs()),
            .phase = store.control().phase,
            .created_utc = store.created_utc(),
            .tags = store.tags()};
  } catch (const StoreError& error) {
    return {.file = file, .problem = error.what()};
  }
}

[[noreturn]] void refuse(const std::filesystem::path& place, std::string_view what) {
  throw ArchiveError(fmt::format("campaign file = {} ({})", place.string(), what));
}

std::vector<std::filesystem::path> campaign_files_in(const std::filesystem::path& directory) {
  std::error_code error;
  std::vector<std::filesystem::path> files;
  for (std::filesystem::directory_iterator entry(directory, error), end; !error && entry != end;
       entry.increment(error)) {
    if (entry->path().extension() != ".db" || !may_be_campaign(entry->path())) continue;
    files.push_back(entry->path());
  }
  if (error) {
    throw ArchiveError(
        fmt::format("directory = {} (cannot be read: {})", directory.string(), error.message()));
  }
  std::ranges::sort(files);
  return files;
}

}  // namespace

std::vector<ListedCampaign> list_campaigns(std::span<const std::filesystem::path> places) {
  std::vector<ListedCampaign> campaigns;
  for (const std::filesystem::path& place : places) {
    std::error_code ignored;
    if (std::filesystem::is_directory(place, ignored)) {
      for (const auto& file : campaign_files_in(place)) campaigns.push_back(listed(file));
      continue;
    }
    if (!std::filesystem::exists(place, ignored)) refuse(place, "does not exist");
    if (!may_be_campaign(place)) refuse(place, "is not a Proofmass campaign");
    campaigns.push_back(listed(place));
  }
  return campaigns;
}

}  // namespace proofmass::coordinator
