#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "coordinator/net/campaign_files.hpp"

namespace proofmass::coordinator {

/// The directory in which a coordinator keeps its campaigns, one file NAME.db each. Nobody else's:
/// a second coordinator on the directory is refused.
class CampaignFolder final : public CampaignFiles, public CampaignDirectory {
 public:
  /// Takes the directory, making it if it is not there, for this user only.
  /// @throws Error if it cannot be made or written, or if another coordinator has it.
  explicit CampaignFolder(std::filesystem::path directory);
  ~CampaignFolder() override;
  CampaignFolder(const CampaignFolder&) = delete;
  CampaignFolder& operator=(const CampaignFolder&) = delete;

  /// All files NAME.db, by name.
  [[nodiscard]] std::vector<std::filesystem::path> list() const override;
  [[nodiscard]] ServedCampaign load(const std::filesystem::path& file) const override;

  [[nodiscard]] ServedCampaign open(const Campaign& wanted, const StopPlan& plan,
                                    const Asker& asker) override;
  void require_same(const std::filesystem::path& file, const Campaign& wanted) override;
  [[nodiscard]] std::shared_ptr<const Campaign> extend(Store& store,
                                                       const Campaign& wanted) override;
  std::optional<std::uint64_t> summarise(
      const std::filesystem::path& file, const Campaign& campaign,
      const std::function<void(const std::function<void(Store&)>&)>& write) override;

 private:
  [[nodiscard]] std::filesystem::path file_of(const Campaign& campaign) const;

  std::filesystem::path directory_;
  int lock_;  ///< Descriptor.
};

}  // namespace proofmass::coordinator
