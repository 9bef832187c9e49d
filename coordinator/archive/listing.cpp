#include "coordinator/archive/listing.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <system_error>

#include "coordinator/archive/archive_error.hpp"
#include "coordinator/archive/stored_campaign.hpp"
#include "coordinator/report/text_cells.hpp"
#include "coordinator/store/store.hpp"
#include "core/runs.hpp"
#include "proto/text/visible_text.hpp"
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

constexpr std::array<TextColumn, 7> columns{{{"file", 18, true},
                                             {"campaign", 14, true},
                                             {"phase", 10, true},
                                             {"done", 9},
                                             {"runs", 9},
                                             {"seed", 9},
                                             {"created", 11}}};

std::vector<std::string> cells_of(const ListedCampaign& campaign) {
  constexpr std::size_t date_size = 10;  // 2024-02-29 of 2024-02-29T12:00:10Z.
  return {wire::visible_text(campaign.file.filename().string()),
          wire::visible_text(campaign.name),
          std::string(wire::name_of(campaign.phase)),
          std::to_string(campaign.num_finished),
          std::to_string(campaign.num_runs),
          std::to_string(campaign.seed),
          wire::visible_text(campaign.created_utc.substr(0, date_size))};
}

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

std::string listing_text(std::span<const ListedCampaign> campaigns, std::size_t line_width_max) {
  if (campaigns.empty()) return "no campaigns\n";
  std::vector<std::vector<std::string>> rows;
  for (const ListedCampaign& campaign : campaigns) rows.push_back(cells_of(campaign));
  const std::vector<TextColumn> wide = widened(columns, rows, line_width_max);
  std::string text = table_heading(wide);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const ListedCampaign& campaign = campaigns[i];
    if (campaign.problem.empty()) {
      text += table_row(wide, rows[i]);
    } else {
      text += rows[i].front() + "\n  " + campaign.problem + "\n";
    }
  }
  return text;
}

std::string listing_json(std::span<const ListedCampaign> campaigns) {
  constexpr int indent = 2;
  Json json{{"campaigns", Json::array()}};
  for (const ListedCampaign& campaign : campaigns) json["campaigns"].push_back(json_of(campaign));
  return json.dump(indent, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace proofmass::coordinator
