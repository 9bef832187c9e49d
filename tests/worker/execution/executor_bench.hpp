#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <semaphore>
#include <span>
#include <utility>
#include <vector>

#include "core/microscope/campaign/microscope_campaign.hpp"
#include "tests/support/messages.hpp"
#include "tests/support/microscope_results.hpp"
#include "tests/support/prepared_campaign.hpp"
#include "worker/execution/executor.hpp"

namespace proofmass::worker {

using Indices = std::vector<std::uint64_t>;
using test::PreparedCampaign;

inline constexpr wire::CampaignId first_campaign{1};
inline constexpr wire::CampaignId second_campaign{2};

inline std::shared_ptr<const Campaign> definition() {
  return std::make_shared<const MicroscopeCampaign>();
}

inline proto::RunLease lease(std::uint64_t first, std::uint64_t count,
                             wire::CampaignId campaign = first_campaign) {
  return test::make_lease(campaign, {{first}, count}, {3});
}

inline void submit(Executor& executor, const proto::RunLease& lease) {
  executor.submit(lease, std::array{wire::runs_of(lease)});
}

/// Runs that yield their index as number of draws, the size of their batch as number of rounds and
/// their first table value as truth.
inline std::vector<RunResult> results_of(std::span<const RunRequest> requests) {
  std::vector<RunResult> results;
  for (const RunRequest& request : requests) {
    RunResult result = test::zero_result({.run = request.run});
    result.num_draws = static_cast<std::uint32_t>(request.run.value);
    result.num_rounds = static_cast<std::uint32_t>(requests.size());
    result.truth[0] = request.table_values.empty() ? 0.0 : request.table_values.front();
    results.push_back(result);
  }
  return results;
}

/// Such runs, after `num_steps` steps, of each of which they report twice.
inline Prepare prepare_counting(int num_steps) {
  return [num_steps](const Campaign&) -> PreparedCampaign {
    return {.simulate =
                [num_steps](std::span<const RunRequest> requests,
                            const std::function<void(int)>& progress) {
                  for (int half = 1; half <= 2 * num_steps; ++half) progress(half / 2);
                  return results_of(requests);
                },
            .num_steps = num_steps};
  };
}

/// An executor whose finished runs can be waited for; its first campaign is defined.
class Bench {
 public:
  explicit Bench(Prepare prepare, const ExecutorConfig& config = {})
      : executor(
            std::move(prepare), [this] { changed_.release(); }, config) {
    executor.define(first_campaign, definition());
  }

  std::vector<wire::LeasedResult> wait_for(std::size_t count) {
    std::vector<wire::LeasedResult> all;
    while (all.size() < count) {
      changed_.acquire();
      for (wire::LeasedResult& run : executor.take_finished()) all.push_back(std::move(run));
    }
    return all;
  }

  void wait_for_change() { changed_.acquire(); }

 private:
  std::counting_semaphore<> changed_{0};

 public:
  Executor executor;
};

inline Indices indices_of(const std::vector<wire::LeasedResult>& runs) {
  Indices indices;
  for (const wire::LeasedResult& run : runs) indices.push_back(run.computed.result.run.value);
  return indices;
}

/// Batches of ten steps that wait, after their first, until they are let go.
struct Gate {
  std::counting_semaphore<> entered{0};
  std::counting_semaphore<> open{0};

  Prepare prepare() {
    return [this](const Campaign&) -> PreparedCampaign {
      return {.simulate =
                  [this](std::span<const RunRequest> requests,
                         const std::function<void(int)>& progress) {
                    progress(1);
                    entered.release();
                    open.acquire();
                    progress(10);
                    return results_of(requests);
                  },
              .num_steps = 10};
    };
  }
};

}  // namespace proofmass::worker
