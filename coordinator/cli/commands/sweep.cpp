#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <vector>

#include "coordinator/archive/comparison.hpp"
#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/cli/campaign_databases.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/commands/run.hpp"
#include "coordinator/cli/program.hpp"
#include "coordinator/report/read_results.hpp"
#include "coordinator/store/sha256.hpp"
#include "coordinator/store/store.hpp"
#include "core/runs.hpp"
#include "proto/command_line/option_checks.hpp"
#include "proto/link/machine.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

struct SweepOptions {
  RunOptions run;  ///< Of each campaign, but for its database and the varied values.
  std::vector<std::string> varied;
  std::optional<std::filesystem::path> directory;  ///< By default STEM-sweep in the current one.
  OutputFormat format = OutputFormat::text;
};

std::filesystem::path directory_of_sweep(const SweepOptions& options) {
  return options.directory.value_or(options.run.campaign_file.stem().string() + "-sweep");
}

/// What is left to be done of a campaign.
struct Rest {
  std::uint64_t num_missing = 0;  ///< Runs, at most.
  std::optional<int> exit_code;   ///< If it is finished already: what `run` ended with.
};

/// One campaign of a sweep, ready to be run.
struct SweptCampaign {
  SweptValues values;
  RunOptions run;
  Rest rest = {};
};

using Sweep = std::vector<SweptCampaign>;

RunOptions run_options_of(const SweepOptions& options, const SweptValues& values) {
  RunOptions run = options.run;
  run.output.reset();
  run.database =
      directory_of_sweep(options) / sweep_file_name(run.campaign_file.stem().string(), values);
  for (const auto& [key, value] : values) run.overrides.assignments.push_back(key + "=" + value);
  return run;
}

/// The messages of a campaign file name an assignment by the option that usually makes it.
std::string in_words_of_sweep(const std::string& message, const SweptValues& values) {
  for (const auto& [key, value] : values) {
    const std::string assignment = fmt::format("--set {}=", key);
    if (message.starts_with(assignment)) {
      return fmt::format("--vary {}={}", key, message.substr(assignment.size()));
    }
  }
  return message;
}

std::unique_ptr<Campaign> read_swept(const SweptCampaign& swept) {
  try {
    return read_campaign(swept.run.campaign_file, swept.run.overrides);
  } catch (const DefinitionError& error) {
    throw UsageError(in_words_of_sweep(error.what(), swept.values));
  }
}

/// @throws UsageError if there is a database of another campaign, or of one with more runs.
Rest rest_of(const Campaign& campaign, const RunOptions& run) {
  const std::filesystem::path& database = *run.database;
  if (!std::filesystem::exists(database))
    return {.num_missing = campaign.num_runs, .exit_code = {}};
  const Store store = Store::open_read_only(database);
  require_same(store, campaign, database, "name another directory with --directory");
  require_no_fewer_runs(store, campaign, database);
  const std::uint64_t num_finished_runs = num_runs_in(store.finished_runs());
  const std::optional<Summary> summary = store.summary();
  // A file at rest, whose statistics are those of its results.
  const bool is_complete = store.control().phase == wire::CampaignPhase::finished && summary &&
                           summary->num_finished == num_finished_runs &&
                           store.given_up_runs().empty() && !lacks_stop_check(store) &&
                           store.stop_plan() == stop_plan_of(run, campaign.num_runs);
  const bool has_all = num_finished_runs == campaign.num_runs || !run.stop.stop_rule.empty();
  if (is_complete && has_all) {
    const bool is_doubtful = is_rule_missed(store) || store.num_contradicting() > 0;
    return {.num_missing = 0, .exit_code = is_doubtful ? exit_not_met : exit_done};
  }
  return {.num_missing = campaign.num_runs - num_finished_runs, .exit_code = {}};
}

/// Reads and checks every campaign before any is run, so that a sweep does not end in the middle
/// because of its arguments.
Sweep plan_sweep(const SweepOptions& options) {
  std::vector<VariedKey> keys;
  for (const std::string& text : options.varied) keys.push_back(parse_varied(text));
  Sweep sweep;
  std::map<std::string, std::string> values_of_definition;
  for (const SweptValues& values : combinations(keys)) {
    SweptCampaign& swept =
        sweep.emplace_back(SweptCampaign{.values = values, .run = run_options_of(options, values)});
    const std::unique_ptr<Campaign> campaign = read_swept(swept);
    const auto [same, is_new] = values_of_definition.emplace(
        campaign->definition(TableColumns::left_out).text, text_of(values));
    if (!is_new) {
      throw UsageError(
          fmt::format("vary = {} (makes the same campaign as {})", text_of(values), same->second));
    }
    check_until(*campaign, swept.run.stop.stop_rule);
    swept.rest = rest_of(*campaign, swept.run);
  }
  return sweep;
}

/// What the missing runs of these campaigns take. The time of a step is measured with the first,
/// and the length of a run is looked up for a few of them, as preparing one takes a tenth of a
/// second: the others are taken to be like the one before them.
CostEstimate cost_of(const std::vector<const SweptCampaign*>& unfinished) {
  constexpr std::size_t num_prepared_max = 8;
  const std::size_t stride = unfinished.size() / num_prepared_max + 1;
  CostEstimate cost;
  double step_s = 0.0;  // Of a batch.
  int num_steps = 0;
  std::unique_ptr<const Campaign> campaign;
  for (std::size_t i = 0; i < unfinished.size(); ++i) {
    if (i % stride == 0) {
      campaign = read_swept(*unfinished[i]);
      const std::unique_ptr<const Plan> plan = campaign->prepare();
      num_steps = plan->num_steps();
      if (i == 0) step_s = try_first_batch(*campaign, *plan).time_s / num_steps;
    }
    cost += estimated_cost(*campaign, unfinished[i]->rest.num_missing, step_s * num_steps);
  }
  return cost;
}

void make_sweep_directory(const std::filesystem::path& directory) {
  std::error_code failure;
  std::filesystem::create_directories(directory, failure);
  if (!failure) return;
  throw Error(fmt::format("directory = {} ({})", directory.string(), failure.message()));
}

void say_plan(const Sweep& sweep, const SweepOptions& options) {
  if (options.run.is_quiet) return;
  std::vector<const SweptCampaign*> unfinished;
  for (const SweptCampaign& swept : sweep) {
    if (!swept.rest.exit_code) unfinished.push_back(&swept);
  }
  std::string text =
      fmt::format("proofmass: {} campaigns in {}, {} of them unfinished\n", sweep.size(),
                  directory_of_sweep(options).string(), unfinished.size());
  if (!unfinished.empty()) text += cost_text(cost_of(unfinished));
  wire::say(text);
}

/// Runs one campaign after the other, but for those that are finished: their files stay as they
/// are. What cannot be met or done in one keeps no other from being run.
/// @return exit_interrupted, or the gravest ExitCode of all.
int run_all(const Sweep& sweep, bool is_quiet) {
  const std::atomic<StopRequest>& stop = catch_stop_signals(OnTerminate::stop_now);
  int gravest = exit_done;
  for (std::size_t i = 0; i < sweep.size(); ++i) {
    if (stop != StopRequest::none) return exit_interrupted;
    const SweptCampaign& swept = sweep[i];
    if (!is_quiet && !swept.rest.exit_code) {
      wire::say(fmt::format("proofmass: campaign {} of {}: {}\n", i + 1, sweep.size(),
                            text_of(swept.values)));
    }
    const int exit_code = swept.rest.exit_code ? *swept.rest.exit_code : run_campaign(swept.run);
    if (exit_code == exit_interrupted) return exit_interrupted;
    if (exit_code == exit_cannot_be_done || gravest == exit_done) gravest = exit_code;
  }
  return gravest;
}

void print_comparison(const Sweep& sweep, OutputFormat format, const HeedStop& heed_stop) {
  std::vector<std::filesystem::path> files;
  std::vector<SweptValues> values;
  for (const SweptCampaign& swept : sweep) {
    files.push_back(*swept.run.database);
    values.push_back(swept.values);
  }
  const std::vector<ComparedCampaign> members = compare_several(files, heed_stop);
  if (format == OutputFormat::json) return print_json(comparison_json(members, values));
  write_standard_output(comparison_text(members, sweep_names(values), style_of(stdout).paint));
}

int sweep_campaigns(const SweepOptions& options) {
  wire::ignore_broken_pipes();  // It goes on when nobody reads its progress.
  const Sweep sweep = plan_sweep(options);
  say_plan(sweep, options);
  make_sweep_directory(directory_of_sweep(options));
  const int exit_code = run_all(sweep, options.run.is_quiet);
  if (exit_code == exit_interrupted) {
    wire::say("proofmass: the same command continues the sweep\n");
    return exit_code;
  }
  return run_until_stopped([&](const HeedStop& heed_stop) {
    print_comparison(sweep, options.format, heed_stop);
    return exit_code;
  });
}

}  // namespace

void add_sweep(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<SweepOptions>(
      app, chosen, "sweep", "Run a campaign for each of several values", sweep_campaigns);
  command.footer(exit_codes_text({exit_not_met, exit_interrupted}));
  add_campaign_file(command, options.run.campaign_file);
  command
      .add_option(
          "--vary", options.varied,
          "Values of a key: TABLE.KEY=VALUE,VALUE,...; may\nbe repeated for all combinations")
      ->required()
      ->take_all()
      ->allow_extra_args(false);
  add_path(command, wire::directory_type, "--directory", options.directory,
           "Directory of the databases; by default FILE's\nstem with -sweep, here");
  add_run_options(command, options.run);
  add_json_flag(command, options.format);
}

namespace {

[[noreturn]] void refuse_varied(std::string_view text, std::string_view rule) {
  throw UsageError(fmt::format("vary = {} ({})", text, rule));
}

std::string_view without_blanks(std::string_view text) {
  const std::size_t first = text.find_first_not_of(' ');
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(' ') + 1 - first);
}

/// Where a list of values is cut: at commas that are in no array, table or string of TOML.
class ValueScanner {
 public:
  [[nodiscard]] bool ends_value(char character) {
    if (quote_ != 0) {
      const bool ends_string = character == quote_ && !is_escaped_;
      is_escaped_ = quote_ == '"' && character == '\\' && !is_escaped_;
      if (ends_string) quote_ = 0;
      return false;
    }
    if (character == '"' || character == '\'') quote_ = character;
    if (character == '[' || character == '{') ++depth_;
    if (character == ']' || character == '}') --depth_;
    return character == ',' && depth_ == 0;
  }

 private:
  char quote_ = 0;
  bool is_escaped_ = false;
  int depth_ = 0;
};

std::vector<std::string> values_in(std::string_view list) {
  std::vector<std::string> values;
  ValueScanner scanner;
  std::size_t begin = 0;
  for (std::size_t i = 0; i <= list.size(); ++i) {
    if (i < list.size() && !scanner.ends_value(list[i])) continue;
    values.emplace_back(without_blanks(list.substr(begin, i - begin)));
    begin = i + 1;
  }
  return values;
}

bool is_plain(char character) {
  constexpr std::string_view others = ".,=+-_";
  return (character >= '0' && character <= '9') || (character >= 'a' && character <= 'z') ||
         (character >= 'A' && character <= 'Z') || others.find(character) != std::string_view::npos;
}

}  // namespace

VariedKey parse_varied(std::string_view text) {
  const std::size_t equals = text.find('=');
  const std::string_view key = without_blanks(text.substr(0, equals));
  if (equals == std::string_view::npos || key.empty()) {
    refuse_varied(text, "must be KEY=VALUE,VALUE,...");
  }
  VariedKey varied{.key = std::string(key), .values = values_in(text.substr(equals + 1))};
  for (std::size_t i = 0; i < varied.values.size(); ++i) {
    const std::string& value = varied.values[i];
    if (value.empty()) refuse_varied(text, "must be KEY=VALUE,VALUE,...");
    if (std::ranges::count(varied.values, value) > 1) {
      refuse_varied(text, fmt::format("has the value {} twice", value));
    }
  }
  return varied;
}

std::vector<SweptValues> combinations(std::span<const VariedKey> keys) {
  std::vector<SweptValues> all(1);
  for (std::size_t i = 0; i < keys.size(); ++i) {
    const auto& [key, values] = keys[i];
    if (std::ranges::count(keys, key, &VariedKey::key) > 1) {
      throw UsageError(fmt::format("vary = {} (is given twice)", key));
    }
    if (values.size() > num_swept_max / all.size()) {
      throw UsageError(fmt::format("vary = {} (makes more than {} campaigns)", key, num_swept_max));
    }
    std::vector<SweptValues> longer;
    for (const SweptValues& before : all) {
      for (const std::string& value : values) {
        longer.push_back(before);
        longer.back().emplace_back(key, value);
      }
    }
    all = std::move(longer);
  }
  if (all.size() < 2) throw UsageError("vary = (must make at least two campaigns)");
  return all;
}

std::string text_of(const SweptValues& values) {
  std::string text;
  for (const auto& [key, value] : values) {
    text += fmt::format("{}{}={}", text.empty() ? "" : ",", key, value);
  }
  return text;
}

std::string sweep_file_name(std::string_view stem, const SweptValues& values) {
  constexpr std::size_t size_max = 200, digest_size = 12;
  // A quoted and a bare text are the same value.
  std::string text = text_of(values);
  std::erase_if(text, [](char character) { return character == '"' || character == '\''; });
  std::string plain = text;
  std::ranges::replace_if(
      plain, [](char character) { return !is_plain(character); }, '_');
  std::string name = fmt::format("{}-{}", stem, plain);
  if (plain != text || name.size() > size_max) {
    Sha256 hash;
    hash.add_bytes(text);
    name = fmt::format("{}-{}", name.substr(0, size_max), hash.finish().substr(0, digest_size));
  }
  return name + ".db";
}

MemberNames sweep_names(std::span<const SweptValues> campaigns) {
  constexpr std::size_t columns_max = 15;
  MemberNames names;
  bool are_short = true;
  for (const auto& [key, value] : campaigns.front()) {
    names.title += (names.title.empty() ? "" : ",") + key;
  }
  for (const SweptValues& values : campaigns) {
    std::string name;
    for (const auto& [key, value] : values) name += (name.empty() ? "" : ",") + value;
    are_short = are_short && display_width(name) <= columns_max;
    names.names.push_back(std::move(name));
  }
  if (are_short && display_width(names.title) <= columns_max) return names;
  return lettered(campaigns.size());
}

}  // namespace proofmass::coordinator
