#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "coordinator/net/private_endpoint.hpp"
#include "coordinator/net/service.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "tests/coordinator/net/playing_worker.hpp"
#include "tests/proto/link/scratch_directory.hpp"

namespace proofmass::test {

inline MicroscopeCampaign campaign_of(const std::string& name, std::uint64_t num_runs) {
  MicroscopeCampaign campaign;
  campaign.name = name;
  campaign.num_runs = num_runs;
  return campaign;
}

/// Campaign databases of a test: one NAME.db each, and no look at what is in them.
class PlainFiles final : public coordinator::CampaignFiles {
 public:
  explicit PlainFiles(const ScratchDirectory& directory) : directory_(directory) {}

  coordinator::ServedCampaign open(
      const Campaign& wanted, const coordinator::StopPlan& plan, const coordinator::Asker& asker,
      const std::optional<std::filesystem::path>& known = std::nullopt) override {
    if (known) {
      coordinator::Store store = coordinator::Store::open(*known);
      (void)extend(store, wanted);
      store.set_stop_plan(plan);
      return {.file = *known, .store = std::move(store), .definition = wanted.clone()};
    }
    before_open();
    const auto file = directory_ / (wanted.name + ".db");
    const bool is_new = !std::filesystem::exists(file);
    coordinator::Store store = is_new ? coordinator::Store::create(file, wanted, "definition")
                                      : coordinator::Store::open(file);
    if (is_new && !asker.name.empty()) store.set_owner(asker.name);
    store.set_stop_plan(plan);
    return {.file = file,
            .store = std::move(store),
            .definition = wanted.clone(),
            .elsewhere = {},
            .is_new = is_new};
  }
  std::shared_ptr<const Campaign> extend(coordinator::Store& store,
                                         const Campaign& wanted) override {
    before_extend();
    if (wanted.num_runs < store.num_runs()) throw Error("runs = fewer (must be more)");
    if (wanted.num_runs > store.num_runs()) store.extend(wanted, "definition");
    return wanted.clone();
  }
  std::optional<std::uint64_t> summarise(
      const std::filesystem::path& file, const Campaign&,
      const std::function<void(const std::function<void(coordinator::Store&)>&)>& write) override {
    before_summary();
    std::uint64_t num_runs = 0;
    write([&](coordinator::Store& store) {
      store.record_event("summarised", file.filename().string());
      store_summary(store);
      num_runs = store.num_runs();
    });
    return next_runs(num_runs);
  }

  /// May throw.
  std::function<void()> before_open = [] {};

  /// May throw; called in the writer's thread.
  std::function<void()> before_extend = [] {};

  /// May throw; called in another thread.
  std::function<void()> before_summary = [] {};

  /// In the writer's thread.
  std::function<void(coordinator::Store&)> store_summary = [](coordinator::Store&) {};

  /// What a stop rule asks for, after so many runs.
  std::function<std::optional<std::uint64_t>(std::uint64_t)> next_runs =
      [](std::uint64_t) -> std::optional<std::uint64_t> { return std::nullopt; };

 private:
  const ScratchDirectory& directory_;
};

/// A service in a thread of its own, while the test plays its workers and clients.
class ServiceTest : public testing::Test {
 protected:
  ServiceTest() {
    config.workers_endpoint = endpoint.address();
    config.files = &files;
    config.version = "0.0";
    config.dispatch.reattach_wait = coordinator::Duration::zero();
  }
  ~ServiceTest() override { end(coordinator::StopRequest::now); }

  void start(const std::vector<MicroscopeCampaign>& campaigns) {
    std::vector<coordinator::ServedCampaign> served;
    for (const MicroscopeCampaign& campaign : campaigns)
      served.push_back(files.open(campaign, plan, {}));
    stop = coordinator::StopRequest::none;
    service = std::make_unique<coordinator::Service>(
        std::move(served), config, [this](const coordinator::Event& event) { note(event); });
    thread = std::thread([this] { serve(); });
  }

  /// Waits for a service that ends by itself, and closes its files.
  void wait_for_end() {
    if (!thread.joinable()) return;
    thread.join();
    (void)service->close();
  }

  void end(coordinator::StopRequest request) {
    stop = request;
    wait_for_end();
    service.reset();
  }

  /// As if the process had been killed: nothing is said to anybody, nothing is closed in order.
  void kill() {
    is_killed = true;
    thread.join();
    service.reset();
  }

  /// Lets a function use the service in its own thread, and waits for it.
  void in_service(const std::function<void()>& wish) {
    std::promise<void> promise;
    std::future<void> done = promise.get_future();
    {
      const std::lock_guard lock(mutex);
      wish_ = [&] {
        wish();
        promise.set_value();
      };
    }
    done.get();
  }

  /// Waits for an event whose line begins so; returns the line.
  std::string wait_for_event(const std::string& beginning) {
    std::unique_lock lock(mutex);
    const auto find = [&] {
      return std::find_if(events.begin(), events.end(),
                          [&](const std::string& event) { return event.starts_with(beginning); });
    };
    const bool is_there =
        changed.wait_for(lock, std::chrono::seconds(20), [&] { return find() != events.end(); });
    if (!is_there) throw Error("no event " + beginning);
    return *find();
  }

  /// How many lines of events have begun so until now.
  [[nodiscard]] std::ptrdiff_t num_events(const std::string& beginning) {
    const std::lock_guard lock(mutex);
    return std::count_if(events.begin(), events.end(),
                         [&](const std::string& event) { return event.starts_with(beginning); });
  }

  [[nodiscard]] std::size_t num_stored(const std::string& name) const {
    std::uint64_t count = 0;
    const auto store = coordinator::Store::open_read_only(directory / (name + ".db"));
    for (const RunRange& range : store.finished_runs()) count += range.count;
    return count;
  }

  ScratchDirectory directory;
  coordinator::PrivateEndpoint endpoint;
  PlainFiles files{directory};
  coordinator::StopPlan plan;  ///< Of the campaigns that are there from the start.
  coordinator::ServiceConfig config;
  std::unique_ptr<coordinator::Service> service;
  std::atomic<coordinator::StopRequest> stop = coordinator::StopRequest::none;
  std::atomic<bool> is_killed = false;
  std::thread thread;

 private:
  struct Killed {};

  void note(const coordinator::Event& event) {
    const std::lock_guard lock(mutex);
    events.push_back(to_text(event));
    changed.notify_all();
  }

  void serve() {
    try {
      service->run(stop, [this] { on_turn(); });
    } catch (const Killed&) {
    }
  }

  void on_turn() {
    if (is_killed.exchange(false)) throw Killed();
    std::function<void()> wish;
    {
      const std::lock_guard lock(mutex);
      wish = std::exchange(wish_, nullptr);
    }
    if (wish) wish();
  }

  std::mutex mutex;
  std::condition_variable changed;
  std::function<void()> wish_;
  std::vector<std::string> events;
};

}  // namespace proofmass::test
