#include "coordinator/cli/commands/run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <future>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/cli/campaign_databases.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/local_run.hpp"
#include "coordinator/cli/program.hpp"
#include "coordinator/dispatch/run_set.hpp"
#include "coordinator/net/private_endpoint.hpp"
#include "coordinator/net/service.hpp"
#include "coordinator/page/page.hpp"
#include "coordinator/report/read_results.hpp"
#include "coordinator/report/report.hpp"
#include "coordinator/store/records.hpp"
#include "core/model.hpp"
#include "core/runs.hpp"
#include "core/statistics/stop_rule.hpp"
#include "proto/link/machine.hpp"
#include "proto/model_program/described_model.hpp"
#include "proto/model_program/model_choice.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

constexpr unsigned workers_max = 1024;

std::filesystem::path database_of(const RunOptions& options) {
  return options.database.value_or(options.campaign_file.stem().string() + ".db");
}

/// The runs that are to be computed of a campaign with so many.
RunRange part_of(const RunOptions& options, std::uint64_t num_runs) {
  return options.part.value_or(RunRange{{0}, num_runs});
}

std::uint64_t num_finished(const Store& store, RunRange part) {
  return RunSet(store.finished_runs()).overlap(part).size();
}

std::uint64_t num_missing(const Store& store, const RunOptions& options) {
  const RunRange part = part_of(options, store.num_runs());
  return part.count - num_finished(store, part);
}

std::vector<RunRange> runs_beside(RunRange part, std::uint64_t num_runs) {
  RunSet runs(RunRange{{0}, num_runs});
  runs.remove(part);
  return runs.ranges();
}

/// No more than there are quarters of batches: the runs of one take no longer than one of them.
std::uint64_t num_workers(const RunOptions& options, const Campaign& campaign,
                          std::uint64_t num_runs_missing) {
  const std::uint64_t quarter = (campaign.model().batch_size() + 3) / 4;
  const std::uint64_t num_quarters = (num_runs_missing + quarter - 1) / quarter;
  return std::min<std::uint64_t>(options.num_workers.value_or(wire::num_processors()),
                                 num_quarters);
}

/// The file of a campaign that asks for more runs until its stop rule is reached.
class GrowingFile final : public CampaignFiles {
 public:
  [[nodiscard]] ServedCampaign open(const Campaign& wanted, const StopPlan&, const Asker&,
                                    const std::optional<std::filesystem::path>&) override {
    throw UsageError(fmt::format(
        "campaign {} cannot be submitted: proofmass run serves its own alone", wanted.name));
  }
  [[nodiscard]] std::shared_ptr<const Campaign> extend(Store& store,
                                                       const Campaign& wanted) override {
    store.extend(wanted, wanted.definition(TableColumns::left_out).text);
    return wanted.clone();
  }
  std::optional<std::uint64_t> summarise(
      const std::filesystem::path& file, const Campaign& campaign,
      const std::function<void(const std::function<void(Store&)>&)>& write) override {
    return summarise_file(file, campaign, write);
  }
};

/// What takes time before the first run, and does not need the database: that of a new campaign is
/// made meanwhile, which waits for the disk.
struct RunStart {
  RunStart(std::uint64_t worker_count, const std::string& gpus) : num_workers(worker_count) {
    workers->start_local(num_workers, gpus);
  }

  std::uint64_t num_workers;
  std::future<std::uint64_t> reference_digest = std::async(
      std::launch::async, [] { return built_in_model().reference_digest(best_instruction_set()); });
  PrivateEndpoint endpoint;
  int listener = endpoint.listen();
  std::unique_ptr<WorkerProcesses> workers = std::make_unique<WorkerProcesses>(
      wire::program_beside_this("proofmass-worker"), endpoint.address());
};

/// The service of one campaign for the workers of this process.
ServiceConfig service_config(RunStart& start, CampaignFiles& files) {
  ServiceConfig config;
  config.files = &files;
  config.workers_endpoint = start.endpoint.address();
  config.workers_listener = start.listener;
  config.end = ServiceEnd::when_done;
  config.given_up = GivenUpRuns::retry;
  config.version = PROOFMASS_VERSION;
  config.dispatch.reference_digest = start.reference_digest.get();
  config.dispatch.reattach_wait = Duration::zero();      // Workers of the last time ended with it.
  config.dispatch.lone_witness_wait = Duration::zero();  // No other host can connect.
  config.dispatch.num_slots_expected = start.num_workers * wire::slots_per_thread();
  // All workers may die at once, and runs must be found guilty before the machine is.
  config.dispatch.crashes_per_host_max =
      config.dispatch.crashes_per_run_max * static_cast<std::uint32_t>(start.num_workers + 1);
  return config;
}

/// A page for people who watch the campaign, and a line that says where it is; null if none is
/// wanted.
std::unique_ptr<Page> begin_page(const RunOptions& options, ProgressDisplay& display) {
  if (!options.page.is_wanted()) return nullptr;
  auto page = std::make_unique<Page>(options.page, [&display](const Event& event) {
    if (event.severity != Severity::info) display.note("proofmass: warning: " + to_text(event));
  });
  display.note(fmt::format("proofmass: live page at {}", page->url()));
  return page;
}

/// What nobody needs to see while all goes well goes into the database only.
Log log_to(ProgressDisplay& display) {
  return [&display](const Event& event) {
    // StorageNotes and end_interrupted() tell of the storage.
    if (event.kind == "storage_failed" || event.kind == "results_not_stored") return;
    if (event.severity != Severity::error) return;
    display.note("proofmass: error: " + to_text(event), Tone::bad);
  };
}

/// Tells when nothing can be stored, why, and when that is over.
class StorageNotes {
 public:
  StorageNotes(ProgressDisplay& display, Duration retry_after)
      : display_(display), retry_after_s_(std::chrono::duration<double>(retry_after).count()) {}

  void update(const proto::CampaignStatus& status) {
    if (status.storage_failure() == shown_) return;
    shown_ = status.storage_failure();
    if (shown_.empty()) return display_.note("proofmass: all results are stored again");
    display_.note("proofmass: error: " + wire::visible_text(shown_), Tone::bad);
    display_.note(fmt::format(
        "proofmass: results are kept, and stored when that is possible; tried again every {} s",
        retry_after_s_));
  }

 private:
  ProgressDisplay& display_;
  double retry_after_s_;
  std::string shown_;
};

void make_active(Store& store, const RunOptions& options) {
  CampaignControl active = store.control();
  active.phase = wire::CampaignPhase::active;
  active.audit_fraction = options.audit_fraction.value_or(0.0);
  const Entry control = active;
  (void)store.write({&control, 1});
}

struct Outcome {
  Store store;
  bool is_done = false;  ///< Every run is stored or given up, and the stop rule is decided.
};

/// A campaign that was asked for more runs before computes these first.
void note_late_check(const Store& store, const RunOptions& options, ProgressDisplay& display) {
  if (options.is_quiet || options.stop.stop_rule.empty()) return;
  const std::uint64_t num_runs = store.num_runs();
  const std::uint64_t num_settled =
      num_runs_in(store.finished_runs()) + num_runs_in(store.given_up_runs());
  if (num_runs <= next_stop_check(num_settled)) return;
  display.note(fmt::format(
      "proofmass: the stop rule is checked after {} runs: so many were asked for before",
      num_runs));
}

/// Computes the missing runs, up to `num_runs` in all.
/// @param start  Null if nothing has begun yet.
Outcome compute(ServedCampaign campaign, std::uint64_t num_runs, const RunOptions& options,
                std::unique_ptr<RunStart> start, const std::atomic<StopRequest>& stop) {
  const bool is_decided = options.stop.stop_rule.empty() ||
                          (campaign.store.control().phase == wire::CampaignPhase::finished &&
                           !lacks_stop_check(campaign.store));
  if (num_missing(campaign.store, options) == 0 && is_decided) {
    return {.store = std::move(campaign.store), .is_done = true};
  }
  const RunRange part = part_of(options, num_runs);
  const std::uint64_t num_finished_now = num_finished(campaign.store, part);
  const std::uint64_t num_finished_beside =
      num_runs_in(campaign.store.finished_runs()) - num_finished_now;
  if (options.part) campaign.elsewhere = runs_beside(part, num_runs);
  if (start == nullptr) {
    start = std::make_unique<RunStart>(
        num_workers(options, *campaign.definition, part.count - num_finished_now), options.gpus);
  }
  make_active(campaign.store, options);
  ProgressDisplay display(options.is_quiet        ? DisplayMode::quiet
                          : takes_escapes(stderr) ? DisplayMode::bar
                                                  : DisplayMode::lines,
                          stderr);
  note_late_check(campaign.store, options, display);
  GrowingFile file;
  std::vector<ServedCampaign> campaigns;
  campaigns.push_back(std::move(campaign));
  const ServiceConfig config = service_config(*start, file);
  Service service(std::move(campaigns), config, log_to(display));
  const std::unique_ptr<WorkerProcesses> processes = std::move(start->workers);
  LocalWorkers workers(service, display, *processes);
  StorageNotes storage(display, config.writer.retry_after);
  const auto show = [&] {
    const proto::CampaignStatus status = service.campaigns().front();
    if (!service.is_done()) storage.update(status);  // Otherwise run_campaign() tells why.
    display.update(out_of(status, part.count, num_finished_beside));
  };
  std::unique_ptr<Page> page = begin_page(options, display);
  service.run(stop, [&] {
    if (page) page->on_turn(service);
    if (stop == StopRequest::none && !service.is_done()) workers.replace_dead();
    show();
  });
  show();
  page.reset();  // What it reads would keep the log from being folded in.
  const bool is_done = service.is_done();
  return {.store = std::move(service.close().front().store), .is_done = is_done};
}

int say_interrupted(const Store& store, const RunOptions& options) {
  const RunRange part = part_of(options, store.num_runs());
  wire::say(
      fmt::format("proofmass: interrupted; {} of {} runs are in {}\n"
                  "proofmass: the same command computes the others\n",
                  num_finished(store, part), part.count, database_of(options).string()));
  return exit_interrupted;
}

/// The file alone holds everything, or it is said that its log does too.
void bring_to_rest(Store& store, const std::filesystem::path& database) {
  const std::optional<std::string> reason = store.rest();
  if (!reason) return;
  std::error_code ignored;  // The log lies beside the file that a symbolic link leads to.
  const std::filesystem::path file = std::filesystem::weakly_canonical(database, ignored);
  wire::say(
      fmt::format("proofmass: warning: campaign database = {0} ({1}; copy {2}-wal with it, or make "
                  "copies with `proofmass backup`)\n",
                  database.string(), *reason, file.filename().string()));
}

/// Statistics of a file that cannot be written stay as they are; what is stored is said.
int end_interrupted(Store& store, const Campaign& campaign, const RunOptions& options) {
  store.check_place();
  try {
    update_statistics(store, campaign);
    bring_to_rest(store, database_of(options));
  } catch (const StoreError& error) {
    wire::say(fmt::format("proofmass: error: {}\n", wire::visible_text(error.what())));
  }
  return say_interrupted(store, options);
}

int say_given_up(std::span<const RunRange> given_up, std::uint64_t num_runs) {
  const RunSet runs(given_up);
  wire::say(fmt::format(
      "proofmass: error: {} of {} runs given up, having crashed: {}\n"
      "proofmass: the same command tries them again, in vain if the model itself crashed\n",
      runs.size(), num_runs, to_text(runs)));
  return exit_cannot_be_done;
}

int say_cancelled(const Store& store, std::uint64_t failures_max) {
  wire::say(
      too_many_failures_text(store.num_without_estimate() + num_runs_in(store.given_up_runs()),
                             store.num_runs(), failures_max));
  return exit_cannot_be_done;
}

/// The digest of a program is needed to make or open a database, and takes as long as the program
/// does: it is computed before signals are caught.
void compute_reference_runs(const Model& model, const RunOptions& options) {
  if (model.description().empty()) return;
  if (!options.is_quiet) say_reference_runs(model);
  wire::require_repeatable(model);
}

/// A part must be of the campaign. With a stop rule it would not be known which runs there will be.
void check_part(const RunOptions& options, const Campaign& campaign) {
  if (!options.part) return;
  const std::string range =
      fmt::format("range = {}:{}", options.part->first.value, options.part->end());
  if (options.part->end() > campaign.num_runs) {
    throw UsageError(
        fmt::format("{} (must end at most at campaign.runs = {})", range, campaign.num_runs));
  }
  if (!options.stop.stop_rule.empty()) throw UsageError(range + " (must not be with --until)");
}

void print_outcome(const Store& store, const Campaign& campaign,
                   std::optional<OutputFormat> output) {
  if (!output) return;
  const Review review = read_review(store, campaign, ReviewDepth::matrix);
  if (output == OutputFormat::json) return print_json(report_json(review));
  write_standard_output(report_text(review, style_of(stdout).paint));
}

/// The runs of `50:100`, which are 50 to 99; empty if the text is none such.
std::optional<RunRange> parsed_range(std::string_view text) {
  std::uint64_t first = 0, end = 0;
  const char* const text_end = text.data() + text.size();
  const auto [colon, first_error] = std::from_chars(text.data(), text_end, first);
  if (first_error != std::errc() || colon == text_end || *colon != ':') return std::nullopt;
  const auto [last, end_error] = std::from_chars(colon + 1, text_end, end);
  if (end_error != std::errc() || last != text_end || first >= end) return std::nullopt;
  return RunRange{{first}, end - first};
}

void add_range_option(CLI::App& command, std::optional<RunRange>& part) {
  const auto check = [](const std::string& text) {
    if (parsed_range(text)) return std::string();
    return text + " (must be A:B, whole numbers with A below B)";
  };
  command
      .add_option_function<std::string>(
          "--range", [&part](const std::string& text) { part = parsed_range(text); },
          "Compute runs A to B - 1 only; `merge` joins the\ndatabases of several ranges")
      ->type_name("A:B")
      ->check(CLI::Validator(check, "", "range"));
}

}  // namespace

StopPlan stop_plan_of(const RunOptions& options, std::uint64_t num_runs) {
  StopPlan plan = options.stop;
  if (!plan.stop_rule.empty()) plan.num_runs_max = num_runs;
  return plan;
}

int run_campaign(const RunOptions& options) {
  wire::ignore_broken_pipes();  // A campaign goes on when nobody reads its progress.
  wire::require_threads(num_service_threads);
  const std::unique_ptr<Campaign> campaign =
      read_campaign(options.campaign_file, options.overrides);
  check_until(*campaign, options.stop.stop_rule);
  check_part(options, *campaign);
  options.page.validate();  // Before any file is made.
  const std::filesystem::path database = database_of(options);
  const std::uint64_t num_runs = campaign->num_runs;
  compute_reference_runs(campaign->model(), options);
  const SignalThread signals;
  const std::atomic<StopRequest>& stop = catch_stop_signals(OnTerminate::stop_now);
  std::unique_ptr<RunStart> start;
  if (!std::filesystem::exists(database)) {
    start = std::make_unique<RunStart>(
        num_workers(options, *campaign, part_of(options, num_runs).count), options.gpus);
  }
  Outcome outcome = compute(open_or_create(*campaign, stop_plan_of(options, num_runs), database),
                            num_runs, options, std::move(start), stop);
  if (!outcome.is_done) return end_interrupted(outcome.store, *campaign, options);
  update_statistics(outcome.store, *campaign);
  bring_to_rest(outcome.store, database);
  print_outcome(outcome.store, *campaign, options.output);
  if (outcome.store.control().phase == wire::CampaignPhase::cancelled) {
    return say_cancelled(outcome.store, options.stop.failures_max.value_or(0));
  }
  const std::vector<RunRange> given_up = outcome.store.given_up_runs();
  if (!given_up.empty()) return say_given_up(given_up, outcome.store.num_runs());
  const bool is_doubtful = is_rule_missed(outcome.store) || outcome.store.num_contradicting() > 0;
  return is_doubtful ? exit_not_met : exit_done;
}

void add_run_options(CLI::App& command, RunOptions& options) {
  add_override_options(command, options.overrides);
  add_audit_option(command, options.audit_fraction);
  add_stop_options(command, options.stop);
  add_number(command, "--workers", options.num_workers, {1, workers_max},
             "Worker processes; one a processor by default");
  command
      .add_option(
          "--gpu", options.gpus,
          "NVIDIA cards that simulate, too: none, all, or\nnumbers as in 0,1; none by default")
      ->type_name("CARDS");
  command.add_flag("--quiet", options.is_quiet, "Show no progress");
}

void add_run(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<RunOptions>(
      app, chosen, "run", "Run a campaign, or its missing runs", [](const RunOptions& given) {
        end_at_stop_signals();  // Until there is a file.
        return run_campaign(given);
      });
  command.footer(exit_codes_text({exit_not_met, exit_interrupted}));
  add_campaign_file(command, options.campaign_file);
  add_path(command, database_type, "--db", options.database,
           "Database; by default FILE's stem with .db, here");
  add_range_option(command, options.part);
  add_run_options(command, options);
  add_page_options(command, options.page);
  add_json_flag(command, *options.output);
}

}  // namespace proofmass::coordinator
