#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "coordinator/net/authentication/rights.hpp"
#include "coordinator/net/campaign_files.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/campaign.hpp"
#include "proto/link/whole_file.hpp"

namespace proofmass::coordinator {

/// Compares a campaign's database with the campaign that is wanted, whatever its number of runs.
///
/// @param remedy  What to do if they differ, for the message: `name another database with --db`.
/// @throws UsageError if the database holds another campaign, naming what differs.
void require_same(const Store& store, const Campaign& wanted, const std::filesystem::path& database,
                  std::string_view remedy);

/// Compares the number of runs that a campaign's database was asked for with what is wanted.
/// @throws UsageError if the database holds more.
void require_no_fewer_runs(const Store& store, const Campaign& wanted,
                           const std::filesystem::path& database);

/// Refuses a rule that cannot end a campaign, as its draws may depend on one another or no
/// parameter has the objective that it is about.
///
/// @param stop_rule  May be empty: none.
/// @throws UsageError or ConfigError
void check_until(const Campaign& wanted, const std::string& stop_rule);

/// The database for a campaign, a new one, or the one that exists after require_same(), with as
/// many runs as are wanted; and the campaign with as many runs as are to be computed next, see
/// horizon_of().
/// @param asker  Owner of a new database; must be allowed to control one that exists.
/// @throws UsageError as those do, or if there is a stop rule and quantities are read from
///         tables, which have an end of their own; StoreError if it cannot be used; Error if the
///         asker may not.
[[nodiscard]] ServedCampaign open_or_create(
    const Campaign& wanted, const StopPlan& plan, const std::filesystem::path& database,
    std::string_view remedy = "name another database with --db", const Asker& asker = {});

/// The directory in which a coordinator keeps its campaigns, one file NAME.db each. Nobody else's:
/// a second coordinator on the directory is refused.
class CampaignFolder final : public CampaignFiles, public CampaignDirectory {
 public:
  /// Takes the directory, making it if it is not there, for this user only.
  /// @throws Error if it cannot be made or written, or if another coordinator has it.
  explicit CampaignFolder(std::filesystem::path directory);

  /// All files NAME.db, by name.
  [[nodiscard]] std::vector<std::filesystem::path> list() const override;
  [[nodiscard]] ServedCampaign load(const std::filesystem::path& file) const override;
  /// To the directory `archived` below this one.
  [[nodiscard]] std::filesystem::path archive(const std::filesystem::path& file) const override;
  [[nodiscard]] bool has_archived(const std::string& campaign) const override;
  /// A directory for files that last no longer than this process. It is not there at first: a full
  /// disk must not keep a coordinator from starting.
  [[nodiscard]] std::filesystem::path answers() const { return directory_ / ".answers"; }

  [[nodiscard]] ServedCampaign open(
      const Campaign& wanted, const StopPlan& plan, const Asker& asker,
      const std::optional<std::filesystem::path>& known = std::nullopt) override;
  void require_same(const std::filesystem::path& file, const Campaign& wanted) override;
  [[nodiscard]] std::shared_ptr<const Campaign> extend(Store& store,
                                                       const Campaign& wanted) override;
  std::optional<std::uint64_t> summarise(
      const std::filesystem::path& file, const Campaign& campaign,
      const std::function<void(const std::function<void(Store&)>&)>& write) override;

 private:
  [[nodiscard]] std::filesystem::path file_of(const Campaign& campaign) const;

  std::filesystem::path directory_;
  wire::Descriptor lock_;
};

}  // namespace proofmass::coordinator
