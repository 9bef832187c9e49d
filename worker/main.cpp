#include <functional>
#include <memory>
#include <span>

#include "core/campaign/campaign.hpp"
#include "worker/program.hpp"

namespace {

using namespace proofmass;

/// Runs of one campaign, all with the plan that is made here.
worker::PreparedCampaign prepare(const Campaign& campaign) {
  // Shared by the copies that std::function makes.
  const std::shared_ptr<const Plan> plan = campaign.prepare();
  return {.simulate =
              [plan, set = best_instruction_set()](std::span<const RunRequest> requests,
                                                   const std::function<void(int)>& progress) {
                return plan->simulate_batch(requests, set, progress);
              },
          .num_steps = plan->num_steps(),
          .simulate_on = plan->runs_on_devices() ? worker::SimulateOn([plan](Device& device) {
            return plan->simulation_on(device);
          })
                                                 : nullptr};
}

}  // namespace

int main(int argc, char** argv) {
  return worker::run_worker(argc, argv, {.name = "proofmass-worker", .prepare = prepare});
}
