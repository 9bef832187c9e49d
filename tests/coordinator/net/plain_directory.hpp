#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "coordinator/net/campaign_files.hpp"
#include "tests/coordinator/net/service_fixture.hpp"

namespace proofmass::test {

/// The *.db of a directory, and no look at the definitions in them.
class PlainDirectory final : public coordinator::CampaignDirectory {
 public:
  explicit PlainDirectory(const ScratchDirectory& directory) : directory_(directory / "") {}

  [[nodiscard]] std::vector<std::filesystem::path> list() const override {
    std::vector<std::filesystem::path> files;
    for (const auto& item : std::filesystem::directory_iterator(directory_)) {
      if (item.path().extension() == ".db") files.push_back(item.path());
    }
    return files;
  }

  [[nodiscard]] coordinator::ServedCampaign load(const std::filesystem::path& file) const override {
    {
      const std::lock_guard lock(mutex_);
      ++num_loads_;
      before_load_(file);
    }
    coordinator::Store store = coordinator::Store::open(file);
    auto campaign =
        std::make_shared<MicroscopeCampaign>(campaign_of(store.name(), store.num_runs()));
    return {.file = file, .store = std::move(store), .definition = std::move(campaign)};
  }

  [[nodiscard]] std::filesystem::path archive(const std::filesystem::path& file) const override {
    std::filesystem::path place = std::filesystem::path(file).replace_extension(".archived");
    std::filesystem::rename(file, place);
    return place;
  }

  [[nodiscard]] bool has_archived(const std::string& campaign) const override {
    return std::filesystem::exists(directory_ / (campaign + ".archived"));
  }

  /// Called before a file is opened; may throw.
  void set_before_load(std::function<void(const std::filesystem::path&)> before_load) {
    const std::lock_guard lock(mutex_);
    before_load_ = std::move(before_load);
  }
  [[nodiscard]] int num_loads() const {
    const std::lock_guard lock(mutex_);
    return num_loads_;
  }

 private:
  std::filesystem::path directory_;
  mutable std::mutex mutex_;
  mutable int num_loads_ = 0;
  std::function<void(const std::filesystem::path&)> before_load_ =
      [](const std::filesystem::path&) {};
};

}  // namespace proofmass::test
