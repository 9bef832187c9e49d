#include "tests/fuzz/file_world.hpp"

#include <fmt/format.h>

#include <array>
#include <atomic>
#include <chrono>
#include <exception>
#include <memory>
#include <span>
#include <utility>

#include "coordinator/archive/comparison.hpp"
#include "coordinator/archive/export.hpp"
#include "coordinator/archive/stored_campaign.hpp"
#include "coordinator/archive/verification.hpp"
#include "coordinator/cli/campaign_databases.hpp"
#include "coordinator/net/service.hpp"
#include "coordinator/query/query.hpp"
#include "coordinator/report/read_results.hpp"
#include "coordinator/report/report.hpp"
#include "coordinator/report/requirements.hpp"
#include "coordinator/report/sensitivity.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/independence.hpp"
#include "core/error.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "core/microscope/simulation/run.hpp"
#include "tests/support/microscope_results.hpp"

namespace proofmass::test {
namespace {

namespace fs = std::filesystem;
using namespace coordinator;

constexpr std::uint64_t num_runs = 20;
constexpr wire::SessionId session{0xfedcba9876543210};

void never() {}

/// One orbit at 1 Hz: what `verify` simulates again takes little.
MicroscopeCampaign short_campaign(const std::string& name) {
  MicroscopeCampaign campaign;
  campaign.name = name;
  campaign.num_runs = num_runs;
  campaign.scenario.simulation.sample_period_s = 1.0;
  for (Session& one : campaign.scenario.sessions) one.num_orbits = 1;
  return campaign;
}

MicroscopeCampaign table_campaign() {
  MicroscopeCampaign campaign = short_campaign("tables");
  campaign.dispersions[3] = {.law = Law::table, .file = "draws.csv", .column = "a"};
  campaign.table_columns = {std::vector<double>(num_runs, 1e-4)};
  campaign.scenario.environment.kind = EnvironmentKind::file;
  campaign.environment_file = "environment.csv";
  for (int i = 0; i < 20; ++i) {
    campaign.environment_table.push_back({.time_s = 400.0 * i, .linear_m_s2 = {1e-8, 2e-8, 0.0}});
  }
  return campaign;
}

std::vector<RunResult> simulated(const MicroscopeCampaign& campaign, std::uint64_t count) {
  const RunPlan plan(campaign);
  std::vector<RunResult> results;
  for (std::uint64_t run = 0; run < count;) {
    std::vector<RunRequest> requests;
    for (; run < count && requests.size() < batch_lanes; ++run) {
      requests.push_back({RunIndex{run}, campaign.table_values(RunIndex{run})});
    }
    const auto batch = plan.simulate_batch(requests, best_instruction_set());
    results.insert(results.end(), batch.begin(), batch.end());
  }
  return results;
}

/// Opens a new file with so many results in it.
Store make_file(const fs::path& file, const MicroscopeCampaign& campaign, std::uint64_t count) {
  campaign.validate();
  Store store = Store::create(file, campaign, canonical_definition(campaign));
  store.begin_coordinator(
      {.epoch = wire::Epoch{77}, .host = "host", .process_id = 1, .version = "1"});
  std::vector<Entry> entries{WorkerJoined{
      .session = session, .name = "worker", .host = "host", .process_id = 7, .num_slots = 16}};
  for (const RunResult& result : simulated(campaign, count)) {
    entries.emplace_back(
        Delivery{.result = result, .worker = session, .attempt = {1}, .compute_s = 0.5});
  }
  (void)store.write(entries);
  return store;
}

/// Everything that a campaign can have gone through.
void add_troubles(Store& store, const MicroscopeCampaign& campaign) {
  std::vector<Entry> entries;
  const RunRange lost{.first = RunIndex{16}, .count = 3};
  for (const bool is_blamed : {false, true, true, true}) {
    entries.emplace_back(
        ReturnedRuns{.runs = lost,
                     .attempt = {1},
                     .worker = session,
                     .reason = is_blamed ? wire::LossReason::crashed : wire::LossReason::silent,
                     .is_blamed = is_blamed});
  }
  entries.emplace_back(GivenUpRun{RunIndex{17}});
  entries.emplace_back(EventEntry{.kind = "audit_mismatch", .text = "run=3"});
  RunResult wrong = simulated(campaign, 4).back();
  entries.emplace_back(SecondDelivery{{.result = wrong, .worker = session, .attempt = {2}}});
  wrong.estimate[0] *= 1.5;
  entries.emplace_back(SecondDelivery{{.result = wrong, .worker = {5}, .attempt = {3}}});
  entries.emplace_back(WorkerEnded{.session = session, .reason = wire::LossReason::drained});
  entries.emplace_back(CampaignControl{
      .phase = wire::CampaignPhase::paused, .priority = -3, .audit_fraction = 0.25});
  (void)store.write(entries);
  store.set_stop_plan(
      {.stop_rule = "std(a_c13) within 5%", .num_runs_max = num_runs, .failures_max = 7});
}

/// Rows that nobody keeps.
class NullWriter final : public RowWriter {
 public:
  void begin(std::span<const std::string>) override {}
  [[nodiscard]] bool row(std::span<const Value>) override { return true; }
  void end() override {}
};

void query(const fs::path& file) {
  static const std::array<std::string, 9> questions{
      "SELECT * FROM parameter_accuracy",
      "SELECT * FROM worst_runs",
      "SELECT * FROM campaign_progress",
      "SELECT * FROM overruns",
      "SELECT * FROM error_long",
      "SELECT * FROM worker_throughput",
      "SELECT * FROM attempt_history",
      "SELECT quantity, stdev(value) FROM draw WHERE run_index < 3 GROUP BY quantity",
      "SELECT key, value FROM definition_entry"};
  NullWriter writer;
  for (const std::string& sql : questions) {
    try {
      (void)run_query(file, sql, {.time_limit = std::chrono::seconds(2)}, writer);
    } catch (const Error&) {
    }
  }
}

void read_drawn(const fs::path& file) {
  const Store store = Store::open_read_only(file);
  const std::shared_ptr<const Campaign> campaign = stored_campaign(store);
  const DrawnRuns drawn = read_drawn_runs(store, *campaign, sensitivity_runs_max);
  (void)sensitivity_text(drawn, index(Parameter::k2c), {}, 3);
  if (drawn.runs.empty()) return;
  const RunIndex run = drawn.runs.front();
  const std::vector<double> objectives = campaign->objectives();
  (void)choice_text(drawn, run, objectives);
  (void)sensitivity_text(drawn, worst_quantity_of(drawn, run, objectives), run, 3);
}

void compare(const fs::path& file, const fs::path& pristine) {
  const std::array<fs::path, 2> files{file, pristine};
  const std::vector<ComparedCampaign> members = compare_several(files, never);
  (void)comparison_text(members, lettered(2));
  (void)comparison_json(members);
}

void back_up(const fs::path& file) {
  const fs::path copy = file.parent_path() / "copy.out";
  fs::remove(copy);
  Store::open_read_only(file).back_up(copy);
  (void)Store::open_read_only(copy).finished_runs();
}

void run(const fs::path& file) {
  MicroscopeCampaign wanted = short_campaign("finished");
  wanted.num_runs = num_runs + 5;
  try {
    (void)open_or_create(wanted, {}, file, "remedy");
  } catch (const Error&) {
  }
  Store store = Store::open(file);
  const MicroscopeCampaign campaign = microscope(*stored_campaign(store));
  (void)store.blamed_runs();
  (void)store.given_up_runs();
  (void)store.compared_runs();
  (void)store.contradictions();
  (void)store.attached_sessions();
  const Delivery delivery{
      .result = zero_result({.run = RunIndex{11}, .num_draws = 1, .num_rounds = 1}),
      .worker = session,
      .attempt = {1},
      .compute_s = 0.5};
  (void)store.commit({&delivery, 1});
  (void)summarise_file(file, campaign, [&](const auto& write) { write(store); });
  update_statistics(store, campaign);
}

void serve(const fs::path& file) {
  const fs::path directory = file.parent_path();
  CampaignFolder folder(directory);
  ServiceConfig config;
  config.workers_endpoint = "ipc://" + (directory / "w").string();
  config.clients_endpoint = "ipc://" + (directory / "c").string();
  config.files = &folder;
  config.directory = &folder;
  Service service({}, config, [](const Event&) {});
  const std::atomic<StopRequest> stop = StopRequest::now;
  service.run(stop, [] {});
  for (ServedCampaign& campaign : service.close()) {
    update_statistics(campaign.store, *campaign.definition);
  }
}

void act(FileUse use, const fs::path& file, const fs::path& pristine) {
  switch (use) {
    case FileUse::list: {
      const std::array<fs::path, 1> places{file};
      const auto campaigns = list_campaigns(places);
      (void)terminal_text(listing_table(campaigns));
      (void)listing_json(campaigns);
      return;
    }
    case FileUse::report: {
      const Store store = Store::open_read_only(file);
      (void)report_text(read_review(store, *stored_campaign(store), ReviewDepth::matrix));
      return;
    }
    case FileUse::requirement: {
      const Store store = Store::open_read_only(file);
      const auto campaign = stored_campaign(store);
      if (!why_not_independent(*campaign).empty()) return;  // As the command, which refuses it.
      const std::array<std::string, 2> texts{"a_c12 < 9e-4 for 90% with 90%",
                                             "all objectives for 90% with 90%"};
      const Review review =
          read_review(store, *campaign, ReviewDepth::matrix, numbered_requirements(texts));
      for (const auto& answer : review.matrix) (void)requirement_text(answer);
      return;
    }
    case FileUse::sensitivity:
      return read_drawn(file);
    case FileUse::export_hdf5:
      return export_hdf5(Store::open_read_only(file), file.parent_path() / "export.out", never,
                         DrawColumns::included);
    case FileUse::compare:
      return compare(file, pristine);
    case FileUse::query:
      return query(file);
    case FileUse::verify:
      return verify(
          file, {.fraction = 0.0}, [](const Check& check) { (void)check_text(check); }, never);
    case FileUse::back_up:
      return back_up(file);
    case FileUse::run:
      return run(file);
    case FileUse::serve:
      return serve(file);
  }
}

}  // namespace

std::vector<fs::path> make_seed_files(const fs::path& directory) {
  const std::vector<fs::path> files{directory / "finished.db", directory / "half.db",
                                    directory / "tables.db"};
  const MicroscopeCampaign finished = short_campaign("finished");
  {
    Store store = make_file(files[0], finished, num_runs);
    update_statistics(store, finished);
    store.end_coordinator(wire::Epoch{77});
  }
  {
    const MicroscopeCampaign half = short_campaign("half");
    Store store = make_file(files[1], half, 16);
    add_troubles(store, half);
  }
  const MicroscopeCampaign tables = table_campaign();
  Store store = make_file(files[2], tables, num_runs);
  update_statistics(store, tables);
  return files;
}

std::string use_file(FileUse use, const fs::path& file, const fs::path& pristine) {
  try {
    act(use, file, pristine);
  } catch (const Error&) {  // Refused.
  } catch (const std::exception& error) {
    return error.what();
  }
  return "";
}

std::string take_file(FileUse use, const fs::path& file, const fs::path& pristine) {
  try {
    act(use, file, pristine);
  } catch (const std::exception& error) {
    return error.what();
  }
  return "";
}

}  // namespace proofmass::test
