#include "coordinator/archive/stored_campaign.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <fstream>
#include <string_view>
#include <system_error>

#include "coordinator/archive/archive_error.hpp"
#include "coordinator/report/json.hpp"
#include "coordinator/report/read_results.hpp"
#include "coordinator/store/store.hpp"
#include "core/runs.hpp"
#include "proto/wire/names.hpp"

namespace proofmass::coordinator {
namespace {

// To open a pipe would wait for somebody to write to it.
bool is_file(const std::filesystem::path& path) {
  std::error_code ignored;
  return std::filesystem::is_regular_file(path, ignored);
}

/// True if it has the mark, or is a file that this user may not read.
bool may_be_campaign(const std::filesystem::path& file) {
  return has_campaign_mark(file) ||
         (is_file(file) && ::faccessat(AT_FDCWD, file.c_str(), R_OK, AT_EACCESS) != 0);
}

}  // namespace

void require_campaign_file(const std::filesystem::path& file) {
  const auto refuse = [&](std::string_view what) {
    throw ArchiveError(fmt::format("campaign database = {} ({})", file.string(), what));
  };
  std::error_code ignored;
  if (!std::filesystem::exists(file, ignored)) refuse("does not exist");
  if (!may_be_campaign(file)) refuse("is not a Proofmass campaign");
}

// The header of an SQLite database: its name, and at byte 68 the application_id, big-endian.
bool has_campaign_mark(const std::filesystem::path& file) {
  constexpr std::string_view format{"SQLite format 3\0", 16};
  constexpr std::string_view application = "PrMs";
  constexpr std::size_t application_at = 68;
  if (!is_file(file)) return false;
  std::array<char, application_at + application.size()> header{};
  std::ifstream stream(file, std::ios::binary);
  if (!stream.read(header.data(), header.size())) return false;
  const std::string_view bytes(header.data(), header.size());
  return bytes.starts_with(format) && bytes.substr(application_at) == application;
}

std::vector<std::filesystem::path> databases_in(const std::filesystem::path& directory) {
  std::error_code error;
  std::vector<std::filesystem::path> files;
  for (std::filesystem::directory_iterator entry(directory, error), end; !error && entry != end;
       entry.increment(error)) {
    if (entry->path().extension() == ".db") files.push_back(entry->path());
  }
  if (error) {
    throw ArchiveError(
        fmt::format("directory = {} (cannot be read: {})", directory.string(), error.message()));
  }
  std::ranges::sort(files);
  return files;
}

std::shared_ptr<const Campaign> stored_campaign(const Store& store) {
  std::shared_ptr<const Campaign> campaign;
  store.read_one_state([&] {
    check_definition_digest(store);
    campaign = store.campaign();
  });
  return campaign;
}

namespace {

CampaignRecord listed(const std::filesystem::path& file) {
  try {
    const Store store = Store::open_read_only(file);
    CampaignRecord record = store.record();
    record.file = file;
    record.status.set_num_done(num_runs_in(store.finished_runs()));
    return record;
  } catch (const StoreError& error) {
    return {.file = file, .problem = error.what()};
  }
}

Json record_json(const CampaignRecord& campaign) {
  const std::string file = campaign.file.string();
  if (!campaign.problem.empty()) return {{"file", file}, {"problem", campaign.problem}};
  return {{"file", file},
          {"problem", nullptr},
          {"name", campaign.status.name()},
          {"seed", std::to_string(campaign.seed)},
          {"phase", wire::name_of(wire::phase_of(campaign.status))},
          {"num_runs", campaign.status.num_runs()},
          {"num_finished", campaign.status.num_done()},
          {"created_utc", campaign.created_utc}};
}

}  // namespace

std::vector<CampaignRecord> list_campaigns(std::span<const std::filesystem::path> places) {
  std::vector<CampaignRecord> campaigns;
  for (const std::filesystem::path& place : places) {
    std::error_code ignored;
    if (std::filesystem::is_directory(place, ignored)) {
      for (const std::filesystem::path& file : databases_in(place)) {
        if (may_be_campaign(file)) campaigns.push_back(listed(file));
      }
      continue;
    }
    require_campaign_file(place);
    campaigns.push_back(listed(place));
  }
  return campaigns;
}

Table listing_table(std::span<const CampaignRecord> campaigns) {
  if (campaigns.empty()) return {.remarks = {{"no campaigns"}}};
  constexpr std::size_t date_size = 10;  // 2024-02-29 of 2024-02-29T12:00:10.250Z.
  Table table{.columns = {{"file", true, 18},
                          {"campaign", true, 14},
                          {"phase", true, 10},
                          {"done", false, 9},
                          {"runs", false, 9},
                          {"seed", false, 9},
                          {"created", false, 11}}};
  for (const CampaignRecord& campaign : campaigns) {
    const std::string file = campaign.file.lexically_normal().string();
    if (!campaign.problem.empty()) {
      table.rows.push_back({file, "", "", "-", "-", "-", "-"});
      table.remarks.push_back({campaign.problem, Tone::bad});
      continue;
    }
    const proto::CampaignStatus& status = campaign.status;
    table.rows.push_back({file, status.name(), wire::name_of(wire::phase_of(status)),
                          std::to_string(status.num_done()), std::to_string(status.num_runs()),
                          std::to_string(campaign.seed),
                          campaign.created_utc.substr(0, date_size)});
  }
  return table;
}

Json listing_json(std::span<const CampaignRecord> campaigns) {
  return {{"campaigns", array_of(campaigns, record_json)}};
}

}  // namespace proofmass::coordinator
