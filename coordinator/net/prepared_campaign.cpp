#include "coordinator/net/prepared_campaign.hpp"

#include <fmt/format.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <variant>

#include "coordinator/store/campaign_peek.hpp"
#include "coordinator/store/store_error.hpp"
#include "core/error.hpp"
#include "core/runs.hpp"
#include "proto/link/faults.hpp"
#include "proto/link/machine.hpp"
#include "proto/wire/client_codec.hpp"
#include "proto/wire/names.hpp"

namespace proofmass::coordinator {
namespace {

StoredCampaign stored_campaign_of(const ServedCampaign& campaign, GivenUpRuns given_up) {
  const Store& store = campaign.store;
  const CampaignControl control = store.control();
  StoredCampaign stored{.definition = campaign.definition,
                        .phase = control.phase,
                        .priority = control.priority,
                        .audit_fraction = control.audit_fraction,
                        .finished = store.finished_runs(),
                        .given_up = {},
                        .elsewhere = campaign.elsewhere,
                        .compared = store.compared_runs(),
                        .blamed = {}};
  if (given_up == GivenUpRuns::retry) return stored;
  stored.given_up = store.given_up_runs();
  for (const BlamedRun& blamed : store.blamed_runs()) {
    stored.blamed.push_back(
        {.run = blamed.run, .num_crashes = blamed.num_crashes, .attempt = blamed.attempt});
  }
  return stored;
}

FileFailure copy_of(const std::filesystem::path& file, const std::string& name) {
  return {.file = file,
          .reason = fmt::format("{}: campaign {} is in another file as well", file.string(), name),
          .is_copy = true};
}

EndedCampaign ended_campaign(const std::filesystem::path& file, const CampaignPeek& peek,
                             const std::optional<FileStamp>& stamp) {
  return {.id = peek.id,
          .file = file,
          .status = {.name = peek.name,
                     .phase = peek.phase,
                     .priority = peek.priority,
                     .num_runs = peek.num_runs,
                     .num_done = peek.num_finished,
                     .num_given_up = peek.num_given_up,
                     .remaining_s = {},
                     .storage_failure = {},
                     .owner = peek.owner},
          .created_utc = peek.created_utc,
          .stamp = stamp};
}

/// How many of the files that are looked at hold a campaign, by its name.
using NumFiles = std::map<std::string, int>;

/// Of which campaign a file is.
struct Identity {
  CampaignId id;
  std::string name;
};

/// Empty if the file cannot be read; why is said when it is looked at.
std::optional<Identity> identity_of(const std::filesystem::path& file) {
  try {
    const CampaignPeek peek = peek_campaign(file);
    return Identity{.id = peek.id, .name = peek.name};
  } catch (const std::exception&) {
    if (!has_journal(file)) return std::nullopt;
  }
  try {
    const Store store = Store::open_read_only(file);
    return Identity{.id = store.id(), .name = store.name()};
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
    const std::optional<Identity> identity = identity_of(files[i]);
    if (!identity) continue;
    ++num_files[identity->name];
    if (known.ids.contains(identity->id)) continue;
    places[identity->id].push_back(i);
    names[identity->id] = identity->name;
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
std::optional<CampaignPeek> peek_without_log(const std::filesystem::path& file) {
  try {
    return peek_campaign(file);
  } catch (const StoreError&) {
    if (!has_journal(file)) throw;
    return std::nullopt;
  }
}

/// Any program may have written the file, and clients refuse a list in which one name is wrong.
void require_shown(const std::filesystem::path& file, std::string_view name, std::string_view owner,
                   int priority) {
  const bool has_names = wire::is_name(name) && (owner.empty() || wire::is_name(owner));
  if (has_names && std::abs(std::int64_t{priority}) <= wire::priority_max) return;
  throw Error(fmt::format(
      "campaign database = {} (its name, owner or priority breaks the rules of a campaign file)",
      file.string()));
}

FileOutcome opened(const CampaignDirectory& directory, const std::filesystem::path& file,
                   const KnownCampaigns& known, const NumFiles& num_files,
                   const CoordinatorStart& start) {
  const std::optional<FileStamp> stamp = stamp_of(file);  // Before anything is read.
  if (const std::optional<CampaignPeek> peek = peek_without_log(file)) {
    require_shown(file, peek->name, peek->owner, peek->priority);
    const bool is_known = known.ids.contains(peek->id) || known.names.contains(peek->name);
    const auto found = num_files.find(peek->name);
    const bool has_rival = is_known || found == num_files.end() || found->second > 1;
    // Of several files a damaged one must not stand for the campaign.
    if (has_rival && !has_journal(file)) (void)peek_campaign(file, PeekDepth::pages);
    if (is_known) return copy_of(file, peek->name);
    if (peek->is_at_rest) return ended_campaign(file, *peek, stamp);
  }
  ServedCampaign campaign = directory.load(file);
  if (known.ids.contains(campaign.store.id()) || known.names.contains(campaign.definition->name)) {
    return copy_of(file, campaign.definition->name);
  }
  return prepare(std::move(campaign), GivenUpRuns::keep, start);
}

/// When the campaign of a file was made; empty if the file cannot be opened.
std::string created_utc(const FileOutcome& outcome) {
  if (const auto* const prepared = std::get_if<PreparedCampaign>(&outcome)) {
    return prepared->created_utc;
  }
  const auto* const ended = std::get_if<EndedCampaign>(&outcome);
  return ended == nullptr ? "" : ended->created_utc;
}

wire::Epoch random_epoch() {
  wire::Epoch epoch;
  while (epoch.value == 0) {
    if (getrandom(&epoch.value, sizeof epoch.value, 0) < 0 && errno != EINTR) {
      throw Error(fmt::format("getrandom: {}", std::strerror(errno)));
    }
  }
  return epoch;
}

CoordinatorStart coordinator_start(wire::Epoch epoch, const std::string& version) {
  return {.epoch = epoch,
          .host = wire::host_name(),
          .process_id = static_cast<std::uint64_t>(getpid()),
          .version = version};
}

}  // namespace

void KnownCampaigns::add(const FileOutcome& outcome) {
  if (const auto* const prepared = std::get_if<PreparedCampaign>(&outcome)) {
    files.insert(prepared->campaign.file);
    ids.insert(prepared->campaign.store.id());
    names.insert(prepared->campaign.definition->name);
  } else if (const auto* const ended = std::get_if<EndedCampaign>(&outcome)) {
    files.insert(ended->file);
    ids.insert(ended->id);
    names.insert(ended->status.name);
  }
}

void KnownCampaigns::remove(const EndedFile& ended) {
  files.erase(ended.file);
  ids.erase(ended.id);
  names.erase(ended.name);
}

std::optional<FileStamp> stamp_of(const std::filesystem::path& file) {
  struct stat status {};
  if (::stat(file.c_str(), &status) != 0) return std::nullopt;
  constexpr std::int64_t ns_per_s = 1'000'000'000;
  return FileStamp{.inode = status.st_ino,
                   .size = status.st_size,
                   .written_ns = status.st_mtim.tv_sec * ns_per_s + status.st_mtim.tv_nsec};
}

PreparedCampaign prepare(ServedCampaign campaign, GivenUpRuns given_up,
                         const CoordinatorStart& start) {
  wire::kill_point(wire::KillPoint::after_open);
  Store& store = campaign.store;
  StoredCampaign stored = stored_campaign_of(campaign, given_up);
  const CampaignControl control = store.control();
  require_shown(campaign.file, campaign.definition->name, store.owner(), control.priority);
  const StopPlan plan = store.stop_plan();
  const std::uint64_t num_failures = store.num_without_estimate();
  std::vector<SessionId> sessions = store.attached_sessions();
  std::string owner = store.owner();
  std::string created_utc = store.created_utc();
  store.begin_coordinator(start);
  return {.campaign = std::move(campaign),
          .stored = std::move(stored),
          .control = control,
          .plan = plan,
          .created_utc = std::move(created_utc),
          .owner = std::move(owner),
          .num_failures = num_failures,
          .sessions = std::move(sessions)};
}

std::vector<FileOutcome> look_at_all(const CampaignDirectory& directory, KnownCampaigns& known,
                                     const CoordinatorStart& start) {
  std::vector<std::filesystem::path> files = directory.list();
  std::erase_if(files, [&](const auto& file) { return known.files.contains(file); });
  const NumFiles num_files = order_files(files, known);
  std::vector<FileOutcome> outcomes;
  for (const std::filesystem::path& file : files) {
    try {
      outcomes.push_back(opened(directory, file, known, num_files, start));
    } catch (const std::exception& error) {
      outcomes.emplace_back(FileFailure{.file = file, .reason = error.what()});
    }
    known.add(outcomes.back());
  }
  // The order of submission, which `status` shows and in which campaigns of one priority are lent.
  std::ranges::stable_sort(outcomes, {}, created_utc);
  return outcomes;
}

Beginning beginning_of(std::vector<ServedCampaign> campaigns, GivenUpRuns given_up,
                       const CampaignDirectory* directory, const std::string& version) {
  Beginning beginning{
      .start = coordinator_start(random_epoch(), version), .campaigns = {}, .attached = {}};
  KnownCampaigns known;
  for (ServedCampaign& campaign : campaigns) {
    beginning.campaigns.emplace_back(prepare(std::move(campaign), given_up, beginning.start));
    known.add(beginning.campaigns.back());
  }
  if (directory != nullptr) {
    for (FileOutcome& outcome : look_at_all(*directory, known, beginning.start)) {
      beginning.campaigns.push_back(std::move(outcome));
    }
  }
  for (const FileOutcome& outcome : beginning.campaigns) {
    const auto* const prepared = std::get_if<PreparedCampaign>(&outcome);
    if (prepared == nullptr) continue;
    beginning.attached.insert(prepared->sessions.begin(), prepared->sessions.end());
  }
  return beginning;
}

std::uint64_t definition_size(const Campaign& campaign) {
  const Definition definition = campaign.definition(TableColumns::left_out);
  std::uint64_t num_values = 0;
  for (const DataTable& table : definition.tables) num_values += table.values.size();
  for (const std::vector<double>& column : campaign.table_columns) num_values += column.size();
  return definition.text.size() + sizeof(double) * num_values;
}

}  // namespace proofmass::coordinator
