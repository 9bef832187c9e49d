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
  [[nodiscard]] bool has_directory() const { return num_worst || format == SeriesFormat::csv; }
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

/// The files that a replay of a run writes.
std::vector<std::filesystem::path> files_of(const ReplayOptions& options, RunIndex run,
                                            const SignalSelection& selection) {
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
  if (options.has_directory() && std::filesystem::exists(options.output, ignored) &&
      !std::filesystem::is_directory(options.output, ignored)) {
    refuse_output(options.output, "must be a directory for csv and --worst");
  }
}

std::string text_of(const RunResult& result, const ResultSchema& schema) {
  if (result.status != RunStatus::lost) return std::string(name_of(result.status));
  return fmt::format("lost ({} in {})", name_at(schema.loss_causes, result.loss.cause),
                     name_at(schema.loss_sessions, result.loss.session));
}

/// Simulates the runs one after the other. What was written of a run stays if a later one fails.
class ReplayCommand {
 public:
  ReplayCommand(const ReplayOptions& options, const IsStopped& is_stopped)
      : options_(options),
        is_stopped_(is_stopped),
        store_(Store::open_read_only(options.database)),
        replay_(store_),
        selection_(replay_.recording(), options.sessions, options.groups) {}

  void replay_all() const {
    const std::vector<RunResult> results = chosen();
    std::optional<OutputDirectory> directory;
    if (is_written()) {
      for (const RunResult& result : results) {
        for (const auto& file : files_of(options_, result.run, selection_)) {
          check_output_file(file, options_.if_there, "series are written to files");
        }
      }
      if (options_.has_directory()) directory.emplace(options_.output);
    }
    Json json{{"runs", Json::array()}};
    for (const RunResult& result : results) {
      const std::vector<ResultDifference> differences = replay_one(result);
      if (is_json()) {
        json["runs"].push_back(json_of(result, differences));
      } else {
        print_replayed(result, differences);
      }
      if (differences.empty()) continue;
      if (is_json()) print_json(json);
      flush_standard_output();
      fail(result.run, differences);
    }
    if (is_json()) print_json(json);
  }

 private:
  [[nodiscard]] bool is_written() const { return !options_.output.empty(); }

  [[nodiscard]] std::vector<RunResult> chosen() const {
    if (options_.run) return {replay_.stored_result(RunIndex{*options_.run})};
    return replay_.worst_results(*options_.num_worst, is_stopped_);
  }

  [[nodiscard]] bool is_json() const { return options_.output_format == OutputFormat::json; }

  [[nodiscard]] std::vector<ResultDifference> replay_one(const RunResult& stored) const {
    std::unique_ptr<SeriesOutput> output;
    if (is_written()) output = output_of(stored);
    return replay_.run(stored, output.get(), is_stopped_);
  }

  [[nodiscard]] Json json_of(const RunResult& stored,
                             const std::vector<ResultDifference>& differences) const {
    Json json{{"run", stored.run.value},
              {"status", name_of(stored.status)},
              {"is_equal", differences.empty()},
              {"differences", Json::array()},
              {"files", Json::array()}};
    for (const auto& [run, column, value, computed] : differences) {
      json["differences"].push_back({{"column", column}, {"stored", value}, {"now", computed}});
    }
    if (!is_written() || !differences.empty()) return json;
    for (const auto& file : files_of(options_, stored.run, selection_)) {
      json["files"].push_back(file.string());
    }
    return json;
  }

  void print_replayed(const RunResult& stored,
                      const std::vector<ResultDifference>& differences) const {
    for (const ResultDifference& difference : differences) {
      print_lines(fmt::format("run {} {}: stored {}, now {}\n", stored.run.value, difference.column,
                              difference.stored, difference.computed));
    }
    if (!differences.empty()) return;
    print_lines(fmt::format("run {} {}: all values equal the stored ones\n", stored.run.value,
                            text_of(stored, store_.schema())));
    if (is_written()) {
      for (const auto& file : files_of(options_, stored.run, selection_)) {
        print_lines(fmt::format("wrote {}\n", file.string()));
      }
    }
    flush_standard_output();  // The next run may take long.
  }

  [[nodiscard]] std::unique_ptr<SeriesOutput> output_of(const RunResult& stored) const {
    if (options_.format == SeriesFormat::csv) {
      return csv_series(options_.output, stored.run, selection_);
    }
    return hdf5_series(files_of(options_, stored.run, selection_).front(),
                       {.store = store_, .result = stored, .program_version = PROOFMASS_VERSION},
                       selection_);
  }

  [[noreturn]] static void fail(RunIndex run, const std::vector<ResultDifference>& differences) {
    throw ArchiveError(fmt::format("run {}: {} of its values {} not the stored {}", run.value,
                                   differences.size(), differences.size() == 1 ? "is" : "are",
                                   differences.size() == 1 ? "one" : "ones"));
  }

  const ReplayOptions& options_;
  const IsStopped& is_stopped_;
  Store store_;
  Replay replay_;
  SignalSelection selection_;
};

int replay_runs(const ReplayOptions& options, const IsStopped& is_stopped) {
  check_arguments(options);
  ReplayCommand(options, is_stopped).replay_all();
  return exit_done;
}

}  // namespace

void add_replay(CLI::App& app, Command& chosen) {
  static const std::map<std::string, SeriesFormat> formats{{"csv", SeriesFormat::csv},
                                                           {"hdf5", SeriesFormat::hdf5}};
  auto [command, options] = add_stoppable_command<ReplayOptions>(
      app, chosen, "replay", "Simulate runs again, write their time series", replay_runs);
  add_database(command, options.database);
  command.add_option("--run", options.run, "The run")
      ->check(wire::in_range(std::uint64_t{0}, num_runs_max - 1));
  command
      .add_option("--worst", options.num_worst,
                  "Instead the runs with the largest |error|\nbeside its objective")
      ->check(wire::in_range(std::size_t{1}, num_worst_max));
  command
      .add_option("--output", options.output,
                  "File, or directory for csv and --worst;\nby default nothing is written")
      ->type_name(wire::file_type);
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
