#include "coordinator/archive/replay.hpp"

#include <fmt/format.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <vector>

#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/report/json.hpp"
#include "proto/command_line/option_checks.hpp"

namespace proofmass::coordinator {
namespace {

/// A long run takes seconds and, with all its signals, gigabytes of disk.
constexpr std::size_t num_worst_max = 1000;

enum class SeriesFormat : std::uint8_t { hdf5, csv };

struct ReplayOptions {
  std::filesystem::path database;
  std::optional<std::uint64_t> run;
  std::optional<std::size_t> num_worst;
  std::vector<std::string> sessions;  ///< Empty: all.
  std::vector<std::string> groups;    ///< Empty: all.
  SeriesFormat format = SeriesFormat::hdf5;
  std::filesystem::path output;  ///< Empty: nothing is written.
  wire::IfThere if_there = wire::IfThere::keep;
  OutputFormat output_format = OutputFormat::text;  ///< Of what is printed.

  /// True if `output` names a directory that files are written to.
  [[nodiscard]] bool has_directory() const {
    return !output.empty() && (num_worst || format == SeriesFormat::csv);
  }
};

/// A directory that is made for output; it goes again if nothing was written to it.
class OutputDirectory {
 public:
  explicit OutputDirectory(std::filesystem::path path) : path_(std::move(path)) {
    std::error_code failure;
    is_made_ = std::filesystem::create_directory(path_, failure);
    if (!failure) return;
    throw ArchiveError(
        fmt::format("output = {} (cannot be made: {})", path_.string(), failure.message()));
  }
  ~OutputDirectory() {
    std::error_code ignored;
    if (is_made_) std::filesystem::remove(path_, ignored);  // Only if it is empty.
  }
  OutputDirectory(const OutputDirectory&) = delete;
  OutputDirectory& operator=(const OutputDirectory&) = delete;

 private:
  std::filesystem::path path_;
  bool is_made_ = false;
};

std::vector<std::filesystem::path> files_of(const ReplayOptions& options, RunIndex run,
                                            const SignalSelection& selection) {
  if (options.output.empty()) return {};
  if (options.format == SeriesFormat::hdf5) {
    if (!options.num_worst) return {options.output};
    return {options.output / fmt::format("run{}.h5", run.value)};
  }
  std::vector<std::filesystem::path> files;
  const std::vector<RecordedSession>& sessions = selection.recording().sessions;
  for (std::size_t i = 0; i < sessions.size(); ++i) {
    if (!selection.has_session(i)) continue;
    files.push_back(csv_series_file(options.output, run, sessions[i]));
  }
  return files;
}

void check_arguments(const ReplayOptions& options) {
  if (!options.run && !options.num_worst) {
    throw UsageError("run = (must be given, or --worst)");
  }
  if (options.run && options.num_worst) {
    throw UsageError(fmt::format("worst = {} (must not be given with --run)", *options.num_worst));
  }
  std::error_code ignored;
  const bool is_other =
      options.output == "-" || (std::filesystem::exists(options.output, ignored) &&
                                !std::filesystem::is_directory(options.output, ignored));
  if (options.has_directory() && is_other) {
    refuse_output(options.output, "must be a directory for csv and --worst");
  }
}

std::string text_of(const RunResult& result, const ResultSchema& schema) {
  if (result.status != RunStatus::lost) return std::string(name_of(result.status));
  return fmt::format("lost ({})", loss_text(schema, result.loss));
}

/// A run that was simulated again.
struct ReplayedRun {
  const RunResult& stored;
  std::vector<ResultDifference> differences = {};
  std::vector<std::filesystem::path> files = {};  ///< That were written.
};

Json replayed_json(const ReplayedRun& run) {
  const auto of_difference = [](const ResultDifference& of) -> Json {
    return {{"column", of.column}, {"stored", of.stored}, {"now", of.computed}};
  };
  return {{"run", run.stored.run.value},
          {"status", name_of(run.stored.status)},
          {"is_equal", run.differences.empty()},
          {"differences", array_of(run.differences, of_difference)},
          {"files", array_of(run.files, [](const auto& file) { return Json(file.string()); })}};
}

std::string replayed_text(const ReplayedRun& run, const ResultSchema& schema) {
  std::string text;
  for (const ResultDifference& difference : run.differences) {
    text += fmt::format("run {} {}: stored {}, now {}\n", run.stored.run.value, difference.column,
                        difference.stored, difference.computed);
  }
  if (!run.differences.empty()) return text;
  text = fmt::format("run {} {}: all values equal the stored ones\n", run.stored.run.value,
                     text_of(run.stored, schema));
  for (const auto& file : run.files) text += fmt::format("wrote {}\n", file.string());
  return text;
}

/// Null if no series are written.
std::unique_ptr<SeriesOutput> output_of(const ReplayOptions& options, const Store& store,
                                        const RunResult& stored, const SignalSelection& selection) {
  if (options.output.empty()) return nullptr;
  if (options.format == SeriesFormat::csv) return csv_series(options.output, stored.run, selection);
  return hdf5_series(files_of(options, stored.run, selection).front(),
                     {.store = store, .result = stored, .program_version = PROOFMASS_VERSION},
                     selection);
}

/// Simulates the runs one after the other. What was written of a run stays if a later one fails.
int replay_runs(const ReplayOptions& options, const HeedStop& heed_stop) {
  check_arguments(options);
  const Store store = Store::open_read_only(options.database);
  const Replay replay(store);
  if (!options.output.empty() && replay.recording().sessions.empty()) {
    refuse_output(options.output, fmt::format("must be left out: the model {} has no time series",
                                              store.model_version()));
  }
  const SignalSelection selection(replay.recording(), options.sessions, options.groups);
  const std::vector<RunResult> results =
      options.run ? std::vector{replay.stored_result(RunIndex{*options.run})}
                  : replay.worst_results(*options.num_worst, heed_stop);
  for (const RunResult& result : results) {
    for (const auto& file : files_of(options, result.run, selection)) {
      check_output_file(file, options.if_there, "series are written to files");
    }
  }
  std::optional<OutputDirectory> directory;
  if (options.has_directory()) directory.emplace(options.output);
  const bool is_json = options.output_format == OutputFormat::json;
  Json json{{"runs", Json::array()}};
  for (const RunResult& stored : results) {
    const std::unique_ptr<SeriesOutput> output = output_of(options, store, stored, selection);
    ReplayedRun run{.stored = stored, .differences = replay.run(stored, output.get(), heed_stop)};
    if (run.differences.empty()) run.files = files_of(options, stored.run, selection);
    if (is_json) json["runs"].push_back(replayed_json(run));
    if (!is_json) print_lines(replayed_text(run, store.schema()));
    if (const std::size_t count = run.differences.size(); count > 0) {
      if (is_json) print_json(json);
      flush_standard_output();
      throw ArchiveError(fmt::format("run {}: {} of its values {} not the stored {}",
                                     stored.run.value, count, count == 1 ? "is" : "are",
                                     count == 1 ? "one" : "ones"));
    }
    flush_standard_output();  // The next run may take long.
  }
  if (is_json) print_json(json);
  return exit_done;
}

}  // namespace

void add_replay(CLI::App& app, Command& chosen) {
  static const std::map<std::string, SeriesFormat> formats{{"csv", SeriesFormat::csv},
                                                           {"hdf5", SeriesFormat::hdf5}};
  auto [command, options] = add_stoppable_command<ReplayOptions>(
      app, chosen, "replay", "Simulate runs again, write their time series", replay_runs);
  add_database(command, options.database);
  add_number(command, "--run", options.run, {0, num_runs_max - 1}, "The run");
  add_number(command, "--worst", options.num_worst, {1, num_worst_max},
             "Instead the runs with the largest |error|\nbeside its objective");
  add_path(command, wire::file_type, "--output", options.output,
           "File, or directory for csv and --worst;\nby default nothing is written");
  wire::add_choice(command, "--format", options.format, formats, "hdf5 by default");
  command.add_option("--session", options.sessions, "Write this session only; may be repeated")
      ->allow_extra_args(false);
  command
      .add_option("--group", options.groups, "Write this group of signals only; may be\nrepeated")
      ->allow_extra_args(false);
  add_force_flag(command, options.if_there);
  add_json_flag(command, options.output_format);
}

}  // namespace proofmass::coordinator
