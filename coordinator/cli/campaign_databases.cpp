#include "coordinator/cli/campaign_databases.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <exception>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "coordinator/archive/stored_campaign.hpp"
#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/cli/program.hpp"
#include "coordinator/report/read_results.hpp"
#include "core/campaign/independence.hpp"
#include "core/campaign/name.hpp"
#include "core/error.hpp"
#include "core/model.hpp"
#include "core/result_rules.hpp"
#include "proto/link/whole_file.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

/// What keeps the campaign of a database from going on with a model; empty if nothing does.
std::string model_difference(const Store& store, const Campaign& campaign) {
  const Model& wanted = campaign.model();
  if (store.model_version() != wanted.version()) {
    return fmt::format("model: {} in the database, {} in this program", store.model_version(),
                       wanted.version());
  }
  if (store.model().description_digest() != wanted.description_digest()) {
    return fmt::format(
        "model: {} has another description; a model that has changed needs another version",
        wanted.version());
  }
  if (campaign.tolerates_digests()) return {};
  if (store.reference_digest() == 0) return {};
  const std::uint64_t before = store.reference_digest_for(wanted);
  const std::uint64_t now = wanted.reference_digest(best_instruction_set());
  if (before == now) return {};
  return fmt::format(
      "model: {} computes something else than where the campaign began (digest of its first runs "
      "{:016x}, {:016x} in the database); a model that has changed needs another version",
      wanted.version(), now, before);
}

std::string text_of(const Campaign& campaign) {
  return campaign.definition(TableColumns::left_out).text;
}

}  // namespace

void require_same(const Store& store, const Campaign& wanted, const std::filesystem::path& database,
                  std::string_view remedy) {
  std::vector<std::string> differences;
  const std::string of_model = model_difference(store, wanted);
  // Definitions of two models have nothing in common that could be compared.
  if (store.model().description_digest() == wanted.model().description_digest()) {
    differences = definition_differences(*stored_campaign(store), wanted);
  }
  if (!of_model.empty()) differences.push_back(of_model);
  if (differences.empty()) return;
  std::string text = fmt::format("{} holds another campaign:", database.string());
  for (const std::string& difference : differences) {
    text += fmt::format("\n  {}", wire::visible_text(difference));
  }
  throw UsageError(fmt::format("{}\n{}", text, remedy));
}

void require_no_fewer_runs(const Store& store, const Campaign& wanted,
                           const std::filesystem::path& database) {
  if (wanted.num_runs >= store.num_runs()) return;
  throw UsageError(fmt::format(
      "campaign.runs = {} (must be at least {}, which {} was asked for; set runs in the "
      "campaign file, or --runs of `run` and `submit`)",
      wanted.num_runs, store.num_runs(), database.string()));
}

void check_until(const Campaign& wanted, const std::string& stop_rule) {
  if (stop_rule.empty()) return;
  require_answerable(parse_stop_rule(stop_rule, wanted.results()).requirement, wanted.objectives(),
                     "until", stop_rule);
  if (wanted.table_columns.empty()) return require_independent(wanted, "until", stop_rule);
  throw UsageError(
      fmt::format("until = {} (must not be with quantities whose law is a table)", stop_rule));
}

namespace {

/// Gives a campaign's database as many runs as are wanted. @pre require_same() passed.
void extend_same(Store& store, const Campaign& wanted, const std::filesystem::path& database) {
  require_no_fewer_runs(store, wanted, database);
  if (wanted.num_runs > store.num_runs()) store.extend(wanted, text_of(wanted));
}

/// The campaign as it is to be for now; shared with the dispatch and with messages under way.
std::shared_ptr<const Campaign> with_horizon(const Campaign& wanted, const StopPlan& plan,
                                             std::uint64_t num_runs_now) {
  std::shared_ptr<Campaign> campaign = wanted.clone();
  campaign->num_runs = horizon_of(plan, wanted.num_runs, num_runs_now);
  return campaign;
}

/// The database for a campaign that it holds.
ServedCampaign open_same(const Campaign& wanted, const StopPlan& plan,
                         const std::filesystem::path& database, std::string_view remedy,
                         const Asker& asker) {
  check_until(wanted, plan.stop_rule);
  Store store = Store::open(database);
  require_control(asker, wanted.name, store.owner());
  const std::shared_ptr<const Campaign> campaign = with_horizon(wanted, plan, store.num_runs());
  require_same(store, *campaign, database, remedy);
  check_results_before_more(store);
  extend_same(store, *campaign, database);
  if (store.stop_plan() != plan) store.set_stop_plan(plan);
  return {.file = database, .store = std::move(store), .definition = campaign};
}

}  // namespace

ServedCampaign open_or_create(const Campaign& wanted, const StopPlan& plan,
                              const std::filesystem::path& database, std::string_view remedy,
                              const Asker& asker) {
  if (std::filesystem::exists(database)) return open_same(wanted, plan, database, remedy, asker);
  check_until(wanted, plan.stop_rule);
  const std::shared_ptr<const Campaign> campaign = with_horizon(wanted, plan, 0);
  std::optional<Store> store = Store::create(database, *campaign, text_of(*campaign));
  try {
    if (!asker.name.empty()) store->set_owner(asker.name);
    if (store->stop_plan() != plan) store->set_stop_plan(plan);
  } catch (const std::exception&) {
    store.reset();
    remove_made(database);
    throw;
  }
  return {.file = database, .store = std::move(*store), .definition = campaign, .is_new = true};
}

namespace {

constexpr std::string_view remedy = "give the campaign another name";

[[noreturn]] void refuse(const std::filesystem::path& directory, std::string_view why) {
  throw Error(fmt::format("directory = {} ({})", directory.string(), why));
}

void make_directory(const std::filesystem::path& directory) {
  std::error_code error;
  if (std::filesystem::is_directory(directory, error)) return;
  if (std::filesystem::exists(directory, error)) refuse(directory, "is not a directory");
  std::filesystem::create_directories(std::filesystem::absolute(directory).parent_path(), error);
  if (!error && mkdir(directory.c_str(), S_IRWXU) != 0 && errno != EEXIST) {
    error.assign(errno, std::generic_category());
  }
  if (error) refuse(directory, "cannot be created: " + error.message());
}

/// Kept until the process ends, however it does; the file stays and means nothing by itself.
wire::Descriptor lock(const std::filesystem::path& directory) {
  const std::filesystem::path file = directory / "coordinator.lock";
  wire::Descriptor opened(wire::open_own_file("lock", file, wire::IfAbsent::make));
  const wire::Locked locked = wire::lock_file(opened.number());
  if (locked == wire::Locked::yes) return opened;
  refuse(directory, locked == wire::Locked::by_another ? "another coordinator serves it"
                                                       : wire::no_locks_remedy);
}

}  // namespace

CampaignFolder::CampaignFolder(std::filesystem::path directory) : directory_(std::move(directory)) {
  make_directory(directory_);
  lock_ = lock(directory_);
  // What a process left that was killed.
  std::error_code ignored;
  std::filesystem::remove_all(answers(), ignored);
}

std::vector<std::filesystem::path> CampaignFolder::list() const { return databases_in(directory_); }

ServedCampaign CampaignFolder::load(const std::filesystem::path& file) const {
  Store store = Store::open(file);
  const Model& model = store.model();
  if (!model.can_simulate() && store.reference_digest() == 0) {
    throw Error(fmt::format("{}: model = {} ({})", file.string(), store.model_version(),
                            model.why_no_runs()));
  }
  if (store.model_version() != model.version()) {
    throw Error(fmt::format("{}: model = {} (this program has {})", file.string(),
                            store.model_version(), model.version()));
  }
  std::shared_ptr<const Campaign> definition = stored_campaign(store);
  check_results_before_more(store);
  try {
    check_campaign_name(definition->name, NameOrigin::given);
  } catch (const ConfigError& error) {
    throw Error(fmt::format("{}: {}", file.string(), error.what()));
  }
  return {.file = file, .store = std::move(store), .definition = std::move(definition)};
}

std::filesystem::path CampaignFolder::archive(const std::filesystem::path& file) const {
  const std::filesystem::path archived = directory_ / "archived";
  make_directory(archived);
  std::filesystem::path place = archived / file.filename();
  if (renameat2(AT_FDCWD, file.c_str(), AT_FDCWD, place.c_str(), RENAME_NOREPLACE) != 0) {
    throw Error(fmt::format("archived file = {} ({})", place.string(), std::strerror(errno)));
  }
  for (const std::filesystem::path& changed : {place, file}) {
    (void)wire::synchronise_directory_of(changed);  // The file has a name, old or new, in any case.
  }
  return place;
}

bool CampaignFolder::has_archived(const std::string& campaign) const {
  std::error_code ignored;
  return std::filesystem::exists(directory_ / "archived" / (campaign + ".db"), ignored);
}

// A known file may have come from elsewhere, under any name.
ServedCampaign CampaignFolder::open(const Campaign& wanted, const StopPlan& plan,
                                    const Asker& asker,
                                    const std::optional<std::filesystem::path>& known) {
  return known ? open_same(wanted, plan, *known, remedy, asker)
               : open_or_create(wanted, plan, file_of(wanted), remedy, asker);
}

void CampaignFolder::require_same(const std::filesystem::path& file, const Campaign& wanted) {
  const Store store = Store::open_read_only(file);
  coordinator::require_same(store, wanted, file, remedy);
  check_results_before_more(store);
}

// What the file holds was compared before.
std::shared_ptr<const Campaign> CampaignFolder::extend(Store& store, const Campaign& wanted) {
  extend_same(store, wanted, file_of(wanted));
  return wanted.clone();
}

std::optional<std::uint64_t> CampaignFolder::summarise(
    const std::filesystem::path& file, const Campaign& campaign,
    const std::function<void(const std::function<void(Store&)>&)>& write) {
  return summarise_file(file, campaign, write);
}

std::filesystem::path CampaignFolder::file_of(const Campaign& campaign) const {
  return directory_ / (campaign.name + ".db");
}

}  // namespace proofmass::coordinator
