// Times the kernels on the first NVIDIA card as they are shipped and in other ways that keep the
// bits: `proofmass-card-variants RUNS`. Exits with 1 if one does not yield the reference digest;
// with 0 runs it only finds that out.

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <tuple>
#include <utility>

#include "core/microscope/simulation/reference_digest.hpp"
#include "core/microscope/simulation/run.hpp"
#include "worker/gpu/cuda_device.hpp"

using namespace proofmass;

struct Variant final : worker::CudaDevice {
  using CudaDevice::CudaDevice;
  char blocks = '2';           ///< Of loops that share a processor's registers.
  Queue last = Queue::second;  ///< Of the loops; noise is made in the first one.

  void begin(const char* program) override {
    std::string text = program;
    // The driver compiles the loops for so many.
    text.replace(text.find(".minnctapersm 2"), 15, std::string(".minnctapersm ") + blocks);
    CudaDevice::begin(text.c_str());
  }
  void launch(Queue queue, const Launch& launch) override {
    CudaDevice::launch(std::min(queue, last), launch);
  }
};

int main(int /*argc*/, char** argv) {
  const std::uint64_t num_runs = std::stoull(argv[1]);
  for (const auto& [name, blocks, last] : {std::tuple("as shipped", '2', Device::Queue::second),
                                           std::tuple("three blocks", '3', Device::Queue::second),
                                           std::tuple("in turn", '2', Device::Queue::first)}) {
    Variant device(worker::cuda_cards_of("0").front());
    device.blocks = blocks;
    device.last = last;
    if (prove_device(device)->digest != reference_digest(best_instruction_set())) return 1;
    if (num_runs == 0) {
      fmt::print("{} has the digest\n", name);
      continue;
    }
    const RunPlan plan(MicroscopeCampaign{});
    const auto simulation = plan.simulation_on(device);
    const auto begin = std::chrono::steady_clock::now();
    std::vector<RunRequest> group;
    for (std::uint64_t run = 0; run < num_runs; ++run) {
      group.push_back({RunIndex{run}, {}});
      if (group.size() < simulation->group_size && run + 1 < num_runs) continue;
      simulation->add(run, std::exchange(group, {}));
    }
    while (simulation->num_in_flight() > 0) (void)simulation->advance();
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - begin;
    fmt::print("{:<14} {:8.1f} runs/s\n", name, static_cast<double>(num_runs) / elapsed.count());
    device.begin(".minnctapersm 2");  // The next one has the memory.
  }
}
