#include "coordinator/report/report.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "coordinator/archive/stored_campaign.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/exit_code.hpp"
#include "coordinator/cli/standard_output.hpp"
#include "coordinator/report/requirement_text.hpp"
#include "coordinator/store/store.hpp"

namespace proofmass::coordinator {
namespace {

struct ReportOptions {
  std::filesystem::path database;
  std::vector<std::string> requirements;  ///< See parse_requirement().
};

std::vector<RequirementAnswer> answers_of(const Store& store,
                                          const std::vector<std::string>& requirements) {
  try {
    return check_requirements(store, stored_campaign(store)->objectives(), requirements);
  } catch (const ConfigError& error) {
    throw UsageError(error.what());
  }
}

int print_requirements(const Store& store, const std::vector<std::string>& requirements) {
  bool are_met = true;
  std::string_view separator = "";
  for (const RequirementAnswer& answer : answers_of(store, requirements)) {
    print_lines(fmt::format("{}{}", separator, requirement_text(answer)));
    separator = "\n";
    are_met = are_met && answer.check.verdict == Verdict::met;
  }
  return are_met ? exit_done : exit_not_met;
}

/// Prints the tables of a campaign, finished or not; of requirements, if there are any, the answers
/// instead.
int print_report(const ReportOptions& options) {
  const Store store = Store::open_read_only(options.database);
  if (!options.requirements.empty()) return print_requirements(store, options.requirements);
  print_lines(report_text(store, *stored_campaign(store)));
  return exit_done;
}

}  // namespace

void add_report(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<ReportOptions>(
      app, chosen, "report", "Print the tables of a database", print_report);
  command.footer(exit_codes_text({exit_not_met}));
  command.add_option("DB", options.database, database_text)->required();
  command.add_option("--requirement", options.requirements,
                     "Answer instead whether it is met, as in\n"
                     "\"a_c12 < 9e-4 for 99% with 95%\" or\n"
                     "\"all objectives for 95% with 90%\"; may be repeated");
}

}  // namespace proofmass::coordinator
