#include <fmt/format.h>

#include <filesystem>
#include <string>
#include <vector>

#include "coordinator/archive/comparison.hpp"
#include "coordinator/archive/comparison_text.hpp"
#include "coordinator/archive/several_comparison.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/standard_output.hpp"
#include "coordinator/cli/stop_signals.hpp"
#include "coordinator/store/store.hpp"

namespace proofmass::coordinator {
namespace {

struct CompareOptions {
  std::filesystem::path first;
  std::filesystem::path second;
  std::vector<std::filesystem::path> others;
  OutputFormat format = OutputFormat::text;
};

int compare_two(const CompareOptions& options, const IsStopped& is_stopped) {
  const Store first = Store::open_read_only(options.first);
  const Store second = Store::open_read_only(options.second);
  CampaignComparison comparison;
  first.read_one_state([&] {
    second.read_one_state([&] {
      comparison =
          compare_campaigns(read_compared(first, is_stopped), read_compared(second, is_stopped));
    });
  });
  const std::string first_name = options.first.string(), second_name = options.second.string();
  if (options.format == OutputFormat::json) {
    print_lines(comparison_json(comparison, first_name, second_name));
  } else {
    print_tables(comparison_text(comparison, first_name, second_name));
  }
  return exit_done;
}

int compare_databases(const CompareOptions& options) {
  std::vector<std::filesystem::path> files{options.first, options.second};
  files.insert(files.end(), options.others.begin(), options.others.end());
  if (files.size() > num_compared_max) {
    throw UsageError(
        fmt::format("DB = {} files (must be at most {})", files.size(), num_compared_max));
  }
  return run_until_stopped([&](const IsStopped& is_stopped) {
    if (options.others.empty()) return compare_two(options, is_stopped);
    const std::vector<ComparedMember> members = compare_several(files, is_stopped);
    if (options.format == OutputFormat::json) {
      print_lines(several_json(members));
    } else {
      print_tables(several_text(members, lettered(members.size())));
    }
    return static_cast<int>(exit_done);
  });
}

}  // namespace

void add_compare(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<CompareOptions>(
      app, chosen, "compare", "Compare the results of campaigns", compare_databases);
  command.footer(exit_codes_text({exit_interrupted}));
  add_database(command, options.first, "A");
  add_database(command, options.second, "B");
  command
      .add_option("DB", options.others,
                  "Further databases: each is compared with A, in\none table for each parameter")
      ->type_name(database_type);
  add_json_flag(command, options.format);
}

}  // namespace proofmass::coordinator
