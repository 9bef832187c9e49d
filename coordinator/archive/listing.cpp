#include "coordinator/archive/listing.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <system_error>

#include "coordinator/archive/archive_error.hpp"
#include "coordinator/archive/stored_campaign.hpp"
#include "coordinator/store/store.hpp"
#include "core/runs.hpp"
#include "proto/wire/names.hpp"

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
            .created_utc = store.created_utc()};
  } catch (const StoreError& error) {
    return {.file = file, .problem = error.what()};
  }
}

[[noreturn]] void refuse(const std::filesystem::path& place, std::string_view what) {
  throw ArchiveError(fmt::format("campaign database = {} ({})", place.string(), what));
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

using Json = nlohmann::ordered_json;

Json json_of(const ListedCampaign& campaign) {
  const std::string file = campaign.file.string();
  if (!campaign.problem.empty()) return {{"file", file}, {"problem", campaign.problem}};
  return {{"file", file},
          {"problem", nullptr},
          {"name", campaign.name},
          {"seed", std::to_string(campaign.seed)},
          {"phase", wire::name_of(campaign.phase)},
          {"num_runs", campaign.num_runs},
          {"num_finished", campaign.num_finished},
          {"created_utc", campaign.created_utc}};
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

Table listing_table(std::span<const ListedCampaign> campaigns) {
  if (campaigns.empty()) return {.remarks = {{"no campaigns"}}};
  constexpr std::size_t date_size = 10;  // 2024-02-29 of 2024-02-29T12:00:10Z.
  Table table{.columns = {{"file", true, 18},
                          {"campaign", true, 14},
                          {"phase", true, 10},
                          {"done", false, 9},
                          {"runs", false, 9},
                          {"seed", false, 9},
                          {"created", false, 11}}};
  for (const ListedCampaign& campaign : campaigns) {
    const std::string file = campaign.file.filename().string();
    if (!campaign.problem.empty()) {
      table.rows.push_back({file, "", "", "-", "-", "-", "-"});
      table.remarks.push_back({campaign.problem, Tone::bad});
      continue;
    }
    table.rows.push_back({file, campaign.name, wire::name_of(campaign.phase),
                          std::to_string(campaign.num_finished), std::to_string(campaign.num_runs),
                          std::to_string(campaign.seed),
                          campaign.created_utc.substr(0, date_size)});
  }
  return table;
}

std::string listing_json(std::span<const ListedCampaign> campaigns) {
  constexpr int indent = 2;
  Json json{{"campaigns", Json::array()}};
  for (const ListedCampaign& campaign : campaigns) json["campaigns"].push_back(json_of(campaign));
  return json.dump(indent, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace proofmass::coordinator
