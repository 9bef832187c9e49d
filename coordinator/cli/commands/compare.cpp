#include <fmt/format.h>

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <system_error>
#include <vector>

#include "coordinator/archive/comparison.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "core/campaign/independence.hpp"

namespace proofmass::coordinator {
namespace {

struct CompareOptions {
  std::filesystem::path first;
  std::filesystem::path second;
  std::vector<std::filesystem::path> others;
  OutputFormat format = OutputFormat::text;
};

/// A file that is compared with itself is a slip.
void refuse_same_files(std::span<const std::filesystem::path> files) {
  for (std::size_t i = 1; i < files.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      std::error_code error;  // A file that is not there is refused when it is opened.
      if (!std::filesystem::equivalent(files[i], files[j], error)) continue;
      throw UsageError(
          fmt::format("DB = {} (is the same file as {})", files[i].string(), files[j].string()));
    }
  }
}

int compare_databases(const CompareOptions& options, const IsStopped& is_stopped) {
  std::vector<std::filesystem::path> files{options.first, options.second};
  files.insert(files.end(), options.others.begin(), options.others.end());
  if (files.size() > num_compared_max) {
    throw UsageError(
        fmt::format("DB = {} files (must be at most {})", files.size(), num_compared_max));
  }
  refuse_same_files(files);
  const std::vector<ComparedCampaign> members = compare_several(files, is_stopped);
  if (options.format == OutputFormat::json) {
    print_json(comparison_json(members));
  } else {
    write_standard_output(
        comparison_text(members, lettered(members.size()), style_of(stdout).paint));
  }
  for (const ComparedCampaign& member : members) {
    const std::string why = why_not_independent(*member.campaign);
    if (why.empty()) continue;
    throw UsageError(
        fmt::format("DB = {} (needs independent draws: {})", member.file.string(), why));
  }
  return exit_done;
}

}  // namespace

void add_compare(CLI::App& app, Command& chosen) {
  auto [command, options] = add_stoppable_command<CompareOptions>(
      app, chosen, "compare", "Compare the results of campaigns", compare_databases);
  add_database(command, options.first, "A");
  add_database(command, options.second, "B");
  command.add_option("DB", options.others, "Further databases: each is compared with A")
      ->type_name(database_type);
  add_json_flag(command, options.format);
}

}  // namespace proofmass::coordinator
