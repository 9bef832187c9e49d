#include <fmt/format.h>

#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "coordinator/archive/stored_campaign.hpp"
#include "coordinator/archive/verification.hpp"
#include "coordinator/cli/campaign_databases.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/dispatch/run_set.hpp"
#include "coordinator/report/json.hpp"
#include "coordinator/report/report.hpp"
#include "coordinator/store/store.hpp"
#include "coordinator/table/table.hpp"
#include "core/runs.hpp"
#include "proto/command_line/option_checks.hpp"
#include "proto/link/machine.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

/// Of both commands; `verify` has no output.
struct CheckedFileOptions {
  std::filesystem::path file;    ///< A database, or the archive of one that is to be checked.
  std::filesystem::path output;  ///< Empty: the name of the database with `.tar.gz`.
  std::vector<std::string> authors{"anonymous"};
  wire::IfThere if_there = wire::IfThere::keep;
  bool is_check = false;
  /// Of the runs, simulated again; in [0, 1]. Nothing: some, if their model is here.
  std::optional<double> fraction = {};
  OutputFormat format = OutputFormat::text;
};

VerifyOptions how_to_verify(const std::optional<double>& fraction) {
  return {.fraction = fraction.value_or(fraction_by_default),
          .num_threads = wire::num_processors()};
}

CLI::Option* add_fraction(CLI::App& command, std::optional<double>& fraction,
                          const std::string& whose = "the runs") {
  return add_number(command, "--fraction", fraction, {0.0, 1.0},
                    "Fraction of " + whose + " to simulate again")
      ->default_str(fmt::format("{}", fraction_by_default));
}

Json json_of_check(const Check& check) {
  return {{"name", check.name},
          {"verdict", word_for(check.verdict)},
          {"finding", check.finding},
          {"details", check.details}};
}

/// Prints checks of a file as soon as they are made, and what came of them.
/// @param make_checks  Calls its argument with each.
int print_checks(const CheckedFileOptions& options,
                 const std::function<void(const std::function<void(const Check&)>&)>& make_checks) {
  const std::filesystem::path& file = options.file;
  const bool is_json = options.format == OutputFormat::json;
  bool is_simulated = true;
  std::size_t num_failing = 0, num_checks = 0;
  Json checks = Json::array();
  make_checks([&](const Check& check) {
    ++num_checks;
    if (check.verdict == CheckOutcome::fails) ++num_failing;
    if (check.verdict == CheckOutcome::not_checked && check.name == "simulation") {
      is_simulated = false;
    }
    if (is_json) {
      checks.push_back(json_of_check(check));
      return;
    }
    write_standard_output(check_text(check, style_of(stdout).paint));
    flush_standard_output();  // The simulation may take long.
  });
  if (is_json) {
    print_json({{"file", file.string()}, {"num_failing", num_failing}, {"checks", checks}});
  }
  const bool holds = num_failing == 0;
  if (holds && !is_simulated && options.fraction.value_or(0.0) > 0.0) {
    wire::say(fmt::format("proofmass: error: {}: no run was simulated again, as --fraction asks\n",
                          file.string()));
    return exit_cannot_be_done;
  }
  if (holds) return exit_done;
  wire::say(fmt::format("proofmass: error: {}: {} of {} checks {}\n", file.string(), num_failing,
                        num_checks, num_failing == 1 ? "fails" : "fail"));
  return exit_cannot_be_done;
}

int verify_database(const CheckedFileOptions& options, const HeedStop& heed_stop) {
  return print_checks(options, [&](const auto& report) {
    verify(options.file, how_to_verify(options.fraction), report, heed_stop);
  });
}

int publish_campaign(const CheckedFileOptions& options, const HeedStop& heed_stop) {
  if (options.is_check) {
    return print_checks(options, [&](const auto& report) {
      check_publication(options.file, how_to_verify(options.fraction), report, heed_stop);
    });
  }
  std::filesystem::path output = options.output;
  if (output.empty()) output = options.file.stem().string() + ".tar.gz";
  check_output_file(output, options.if_there, "name one to replace");
  publish(options.file, output, options.if_there, options.authors, heed_stop);
  print_written(output, options.format);
  return exit_done;
}

}  // namespace

void add_verify(CLI::App& app, Command& chosen) {
  auto [command, options] = add_stoppable_command<CheckedFileOptions>(
      app, chosen, "verify", "Check a database, simulate some runs again", verify_database);
  add_database(command, options.file);
  add_fraction(command, options.fraction);
  add_json_flag(command, options.format);
}

void add_publish(CLI::App& app, Command& chosen) {
  auto [command, options] = add_stoppable_command<CheckedFileOptions>(
      app, chosen, "publish", "Write an archive to cite, or check one", publish_campaign);
  add_path(command, wire::file_type, "FILE", options.file, "Database; with --check an archive")
      ->required();
  CLI::Option* const check =
      command.add_flag("--check", options.is_check, "Check an archive, simulate some runs again");
  add_path(command, wire::file_type, "--output", options.output,
           "Archive; by default FILE's stem with .tar.gz, here")
      ->excludes(check);
  command.add_option("--author", options.authors, "Of the results, for citations; may be repeated")
      ->excludes(check);
  add_force_flag(command, options.if_there);
  add_fraction(command, options.fraction)->needs(check);
  add_json_flag(command, options.format);
}

namespace {

struct MergeOptions {
  std::filesystem::path whole;
  std::vector<std::filesystem::path> parts;
  /// Of each part's runs, simulated again; in [0, 1]. One that is not asked for is simulated if it
  /// can be.
  std::optional<double> fraction = {};
  OutputFormat format = OutputFormat::text;
};

/// The campaign of the part that has the most runs, which may have been extended since the others.
struct LargestPart {
  std::shared_ptr<const Campaign> campaign;
  std::filesystem::path part;
};

LargestPart largest_part(const std::vector<std::filesystem::path>& parts) {
  LargestPart largest;
  for (const std::filesystem::path& part : parts) {
    std::shared_ptr<const Campaign> campaign = stored_campaign(Store::open_read_only(part));
    if (largest.campaign != nullptr && campaign->num_runs <= largest.campaign->num_runs) continue;
    largest = {.campaign = std::move(campaign), .part = part};
  }
  return largest;
}

/// Where a campaign with a stop rule ends depends on the results of all runs before.
void require_part(const std::filesystem::path& part, const LargestPart& largest) {
  const Store store = Store::open_read_only(part);
  const std::string remedy =
      fmt::format("asked for by {}; merge databases of one campaign only", largest.part.string());
  require_same(store, *largest.campaign, part, remedy);
  const std::string rule = store.stop_plan().stop_rule;
  if (rule.empty()) return;
  throw UsageError(
      fmt::format("{} has until = {} (must not be in a part of a campaign)", part.string(), rule));
}

/// @throws ArchiveError with the checks that fail.
void require_sound(const std::filesystem::path& part, const MergeOptions& options,
                   const HeedStop& heed_stop) {
  std::string failing;
  const auto collect = [&](const Check& check) {
    const bool is_skipped =
        check.verdict == CheckOutcome::not_checked && check.name == "simulation";
    if (is_skipped && options.fraction.value_or(0.0) > 0.0) {
      failing += fmt::format("\nno run was simulated again, as --fraction asks: {}", check.finding);
    }
    if (check.verdict == CheckOutcome::fails) failing += "\n" + check_text(check);
  };
  verify(part, how_to_verify(options.fraction), collect, heed_stop);
  if (failing.empty()) return;
  while (failing.ends_with('\n')) failing.pop_back();
  throw ArchiveError(fmt::format("{} fails these checks:{}", part.string(), failing));
}

std::string count_text(const MergedPart& part) {
  const std::string num_new = counted(part.num_new, "run");
  if (part.num_again == 0) return num_new;
  return fmt::format("{}, and {} equal to those of parts before it", num_new, part.num_again);
}

RunSet runs_missing_in(const Store& store) {
  RunSet missing(RunRange{{0}, store.num_runs()});
  missing.remove(RunSet(store.finished_runs()));
  return missing;
}

/// The missing runs for people, and how to get them.
std::string missing_text(const Store& store, const RunSet& missing, const MergeOptions& options) {
  if (missing.empty()) return {};
  return fmt::format(
      "{0} of {1} runs are in no part: {2}\n`proofmass run FILE --db {3} --runs {1} --seed {4}` "
      "computes them, with FILE and each --set of the parts\n",
      missing.size(), store.num_runs(), to_text(missing), options.whole.string(), store.seed());
}

void print_merged(const Store& whole, const std::vector<MergedPart>& parts,
                  const MergeOptions& options) {
  const std::string digest = whole.summary()->digests.results;
  std::string lines;
  Json json{{"file", options.whole.string()}, {"parts", Json::array()}};
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const std::string file = options.parts[i].string();
    lines += fmt::format("{}: {}\n", file, count_text(parts[i]));
    json["parts"].push_back(
        {{"file", file}, {"num_new", parts[i].num_new}, {"num_again", parts[i].num_again}});
  }
  const RunSet missing = runs_missing_in(whole);
  if (options.format == OutputFormat::text) {
    return print_lines(lines + missing_text(whole, missing, options) +
                       fmt::format("Digest {}\n", digest));
  }
  json["num_runs"] = whole.num_runs();
  json["num_missing"] = missing.size();
  json["missing"] = array_of(missing.ranges(), [](const RunRange& range) -> Json {
    return {{"first_run", range.first.value}, {"num_runs", range.count}};
  });
  json["digest"] = digest;
  print_json(json);
}

int merge_databases(const MergeOptions& options, const HeedStop& heed_stop) {
  check_new_file("output", options.whole);
  const LargestPart largest = largest_part(options.parts);
  for (const std::filesystem::path& part : options.parts) require_part(part, largest);
  for (const std::filesystem::path& part : options.parts) require_sound(part, options, heed_stop);
  const std::string definition = largest.campaign->definition(TableColumns::left_out).text;
  std::vector<MergedPart> parts;
  Store whole = Store::merge(options.whole, *largest.campaign, definition, options.parts,
                             [&](const MergedPart& part) {
                               heed_stop();
                               parts.push_back(part);
                             });
  update_statistics(whole, *largest.campaign);
  print_merged(whole, parts, options);
  return exit_done;
}

}  // namespace

void add_merge(CLI::App& app, Command& chosen) {
  auto [command, options] = add_stoppable_command<MergeOptions>(
      app, chosen, "merge", "Join databases of parts of a campaign", merge_databases);
  add_path(command, database_type, "OUT", options.whole, "Database to be made of all parts")
      ->required();
  add_path(command, database_type, "PART", options.parts,
           "Databases of one campaign, as of `run --range`")
      ->required();
  add_fraction(command, options.fraction, "each part's runs");
  add_json_flag(command, options.format);
}

}  // namespace proofmass::coordinator
