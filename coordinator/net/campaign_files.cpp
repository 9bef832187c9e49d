#include "coordinator/net/campaign_files.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <exception>
#include <functional>
#include <iterator>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "coordinator/net/service_sockets.hpp"
#include "coordinator/store/campaign_record.hpp"
#include "coordinator/store/records.hpp"
#include "core/error.hpp"
#include "core/model.hpp"
#include "core/runs.hpp"
#include "proto/link/faults.hpp"
#include "proto/link/machine.hpp"
#include "proto/wire/client_codec.hpp"
#include "proto/wire/names.hpp"

namespace proofmass::coordinator {
namespace {

/// 0 for the built-in model. One that older programs began has no digest of its model, nor has one
/// of a model in C++.
std::uint64_t reference_digest_of(const ServedCampaign& campaign) {
  const Model& model = campaign.definition->model();
  if (&model == &built_in_model()) return 0;
  const std::uint64_t recorded = campaign.store.reference_digest_for(model);
  return recorded != 0 ? recorded : model.reference_digest(best_instruction_set());
}

FileLook failed_look(const std::filesystem::path& file, const std::string& failure) {
  return {.record = {.file = file, .problem = failure}};
}

FileLook copy_of(const std::filesystem::path& file, CampaignId id, const std::string& name) {
  FileLook look = failed_look(
      file, fmt::format("{}: campaign {} is in another file as well; move one of them away",
                        file.string(), name));
  look.record.id = id;
  look.is_copy = true;
  return look;
}

/// How many of the files that are looked at hold a campaign, by its name.
using NumFiles = std::map<std::string, int>;

/// Empty if the file cannot be read; why is said when it is looked at.
std::optional<CampaignRecord> record_of(const std::filesystem::path& file) {
  try {
    return peek_campaign(file);
  } catch (const std::exception&) {
    if (!has_journal(file)) return std::nullopt;
  }
  try {
    return Store::open_read_only(file).record();
  } catch (const std::exception&) {
    return std::nullopt;
  }
}

/// Results in a file and its log; −1 if it cannot be read.
std::int64_t num_results(const std::filesystem::path& file) {
  try {
    const Store store = Store::open_read_only(file);
    return static_cast<std::int64_t>(num_runs_in(store.finished_runs()));
  } catch (const std::exception&) {
    return -1;
  }
}

/// The most results come first; of as many, the file that has the campaign's name.
void order_copies(std::vector<std::filesystem::path>& copies, const std::string& name) {
  std::map<std::filesystem::path, std::pair<std::int64_t, bool>> merits;
  for (const std::filesystem::path& file : copies) {
    merits[file] = {num_results(file), file.stem() == name};
  }
  std::ranges::stable_sort(copies, std::ranges::greater(),
                           [&](const auto& file) { return merits.at(file); });
}

/// Lets the files of each campaign that is not known change places with each other: the one that is
/// to be served comes first, so that no older copy stands for the campaign.
NumFiles order_files(std::vector<std::filesystem::path>& files, const KnownCampaigns& known) {
  NumFiles num_files;
  std::map<CampaignId, std::vector<std::size_t>> places;
  std::map<CampaignId, std::string> names;
  for (std::size_t i = 0; i < files.size(); ++i) {
    const std::optional<CampaignRecord> record = record_of(files[i]);
    if (!record) continue;
    ++num_files[record->status.name()];
    if (known.ids.contains(record->id)) continue;
    places[record->id].push_back(i);
    names[record->id] = record->status.name();
  }
  for (const auto& [id, indices] : places) {
    if (indices.size() == 1) continue;
    std::vector<std::filesystem::path> copies;
    for (const std::size_t index : indices) copies.push_back(files[index]);
    order_copies(copies, names.at(id));
    for (std::size_t i = 0; i < indices.size(); ++i) files[indices[i]] = copies[i];
  }
  return num_files;
}

/// By its bytes and without its log: it may be a file that is served under another name. Nothing
/// if that does not tell, as a coordinator that was killed while it folded its log in leaves it.
std::optional<CampaignRecord> peek_without_log(const std::filesystem::path& file) {
  try {
    return peek_campaign(file);
  } catch (const StoreError&) {
    if (!has_journal(file)) throw;
    return std::nullopt;
  }
}

/// Any program may have written the file, and clients refuse a list in which one name is wrong.
void require_shown(const std::filesystem::path& file, const proto::CampaignStatus& status) {
  const bool has_names =
      wire::is_name(status.name()) && (status.owner().empty() || wire::is_name(status.owner()));
  if (has_names && std::abs(std::int64_t{status.priority()}) <= wire::priority_max) return;
  throw Error(fmt::format(
      "campaign database = {} (its name, owner or priority breaks the rules of a campaign file)",
      file.string()));
}

FileLook opened(const CampaignDirectory& directory, const std::filesystem::path& file,
                const KnownCampaigns& known, const NumFiles& num_files,
                const CoordinatorStart& start, std::uint64_t num_reserved) {
  const std::optional<FileStamp> stamp = stamp_of(file);  // Before anything is read.
  if (std::optional<CampaignRecord> record = peek_without_log(file)) {
    require_shown(file, record->status);
    const std::string& name = record->status.name();
    const bool is_known = known.ids.contains(record->id) || known.names.contains(name);
    const auto found = num_files.find(name);
    const bool has_rival = is_known || found == num_files.end() || found->second > 1;
    // Of several files a damaged one must not stand for the campaign.
    if (has_rival && !has_journal(file)) (void)peek_campaign(file, PeekDepth::pages);
    if (is_known) return copy_of(file, record->id, name);
    record->stamp = stamp;
    if (record->is_closed) return {.record = std::move(*record)};
  }
  require_room_for_campaign("campaign database = " + file.string(), num_reserved);
  ServedCampaign campaign = directory.load(file);
  if (known.ids.contains(campaign.store.id()) || known.names.contains(campaign.definition->name)) {
    return copy_of(file, campaign.store.id(), campaign.definition->name);
  }
  return prepare(std::move(campaign), GivenUpRuns::keep, start);
}

}  // namespace

void KnownCampaigns::add(const CampaignRecord& campaign) {
  files.insert(campaign.file);
  ids.insert(campaign.id);
  names.insert(campaign.status.name());
}

void KnownCampaigns::remove(const CampaignRecord& campaign) {
  files.erase(campaign.file);
  ids.erase(campaign.id);
  names.erase(campaign.status.name());
}

FileLook prepare(ServedCampaign campaign, GivenUpRuns given_up, const CoordinatorStart& start) {
  wire::kill_point(wire::KillPoint::after_open);
  Store& store = campaign.store;
  FileLook look{.record = store.record(),
                .stored = {.definition = campaign.definition,
                           .reference_digest = reference_digest_of(campaign),
                           .control = store.control(),
                           .finished = store.finished_runs(),
                           .elsewhere = campaign.elsewhere,
                           .compared = store.compared_runs(),
                           .num_audited = store.num_compared(),
                           .num_mismatches = store.num_contradicting()},
                .plan = store.stop_plan(),
                .num_failures = store.num_without_estimate()};
  if (given_up == GivenUpRuns::keep) {
    look.stored.given_up = store.given_up_runs();
    look.stored.blamed = store.blamed_runs();
  }
  look.record.file = campaign.file;
  look.record.status.set_name(campaign.definition->name);
  require_shown(campaign.file, look.record.status);
  store.begin_coordinator(start);
  look.store = std::move(store);
  return look;
}

std::vector<FileLook> look_at_all(const CampaignDirectory& directory, KnownCampaigns& known,
                                  const CoordinatorStart& start, std::uint64_t num_reserved) {
  std::vector<std::filesystem::path> files = directory.list();
  std::erase_if(files, [&](const auto& file) { return known.files.contains(file); });
  const NumFiles num_files = order_files(files, known);
  std::vector<FileLook> looks;
  for (const std::filesystem::path& file : files) {
    try {
      looks.push_back(opened(directory, file, known, num_files, start, num_reserved));
    } catch (const std::exception& error) {
      looks.push_back(failed_look(file, error.what()));
    }
    if (looks.back().record.problem.empty()) known.add(looks.back().record);
  }
  // The order of submission, which `status` shows and in which campaigns of one priority are lent.
  std::ranges::stable_sort(looks, {}, [](const FileLook& look) { return look.record.created_utc; });
  return looks;
}

CoordinatorStart coordinator_start(const std::string& version) {
  return {.epoch = {wire::random_number()},
          .host = wire::host_name(),
          .process_id = static_cast<std::uint64_t>(getpid()),
          .version = version};
}

std::vector<FileLook> looks_at_beginning(std::vector<ServedCampaign> campaigns,
                                         GivenUpRuns given_up, const CampaignDirectory* directory,
                                         const CoordinatorStart& start,
                                         std::uint64_t num_reserved) {
  std::vector<FileLook> looks;
  KnownCampaigns known;
  for (ServedCampaign& campaign : campaigns) {
    looks.push_back(prepare(std::move(campaign), given_up, start));
    known.add(looks.back().record);
  }
  if (directory != nullptr) {
    std::ranges::move(look_at_all(*directory, known, start, num_reserved + descriptors_of_sockets),
                      std::back_inserter(looks));
  }
  return looks;
}

std::set<SessionId> sessions_of(const std::vector<FileLook>& looks) {
  std::set<SessionId> sessions;
  for (const FileLook& look : looks) {
    if (look.store)
      std::ranges::copy(look.store->attached_sessions(), std::inserter(sessions, sessions.end()));
  }
  return sessions;
}

std::uint64_t definition_size(const Campaign& campaign) {
  const Definition definition = campaign.definition(TableColumns::left_out);
  std::uint64_t num_values = 0;
  for (const DataTable& table : definition.tables) num_values += table.values.size();
  for (const std::vector<double>& column : campaign.table_columns) num_values += column.size();
  return definition.text.size() + sizeof(double) * num_values;
}

}  // namespace proofmass::coordinator
