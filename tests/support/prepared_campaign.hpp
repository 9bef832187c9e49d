#pragma once

#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "core/campaign/campaign.hpp"
#include "core/campaign/device.hpp"
#include "core/campaign/recording.hpp"

namespace proofmass::test {

/// What a plan does of which a test says how it computes runs.
struct PreparedCampaign {
  std::function<std::vector<RunResult>(std::span<const RunRequest> requests,
                                       const std::function<void(int)>& progress)>
      simulate;
  int num_steps = 1;
  std::function<std::unique_ptr<DeviceSimulation>(Device&)> simulate_on{};

  operator std::shared_ptr<const Plan>() const;
};

class PlanOfATest final : public Plan {
 public:
  explicit PlanOfATest(PreparedCampaign prepared) : prepared_(std::move(prepared)) {}

  [[nodiscard]] std::vector<RunResult> simulate_batch(
      std::span<const RunRequest> requests, InstructionSet,
      const std::function<void(int)>& progress) const override {
    return prepared_.simulate(requests, progress);
  }
  [[nodiscard]] RunResult replay(const RunRequest& request, const SampleSink&,
                                 const std::function<void(int)>& progress) const override {
    return prepared_.simulate({&request, 1}, progress).front();
  }
  [[nodiscard]] bool runs_on_devices() const override { return prepared_.simulate_on != nullptr; }
  [[nodiscard]] std::unique_ptr<DeviceSimulation> simulation_on(Device& device) const override {
    return prepared_.simulate_on(device);
  }
  [[nodiscard]] const Recording& recording() const override { return recording_; }
  [[nodiscard]] int num_steps() const override { return prepared_.num_steps; }

 private:
  const PreparedCampaign prepared_;
  const Recording recording_;
};

inline PreparedCampaign::operator std::shared_ptr<const Plan>() const {
  return std::make_shared<const PlanOfATest>(*this);
}

}  // namespace proofmass::test
