#include "coordinator/report/report.hpp"

#include <algorithm>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "coordinator/archive/stored_campaign.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/remote_answer.hpp"
#include "coordinator/cli/standard_output.hpp"
#include "coordinator/report/report_json.hpp"
#include "coordinator/report/requirements.hpp"
#include "coordinator/store/store.hpp"

namespace proofmass::coordinator {
namespace {

struct ReportOptions {
  std::filesystem::path database;
  std::vector<std::string> requirements;  ///< See parse_requirement().
  OutputFormat format = OutputFormat::text;
  ClientConnectionConfig connection;  ///< Of a coordinator, if it is to be asked.
};

std::vector<RequirementAnswer> answers_of(const Store& store, const Campaign& campaign,
                                          const std::vector<std::string>& requirements) {
  try {
    return check_requirements(store, campaign.objectives(), requirements);
  } catch (const ConfigError& error) {
    throw UsageError(error.what());
  }
}

std::string answers_text(const std::vector<RequirementAnswer>& answers) {
  std::string text;
  for (const RequirementAnswer& answer : answers) {
    text += (text.empty() ? "" : "\n") + requirement_text(answer);
  }
  return text;
}

int print_remote_report(const ReportOptions& options) {
  wire::AnswerRequest question{.campaign = checked_campaign_name(options.database),
                               .question = wire::Question::report};
  for (const std::string& requirement : options.requirements) {
    question.options.push_back("--requirement=" + requirement);
  }
  if (options.format == OutputFormat::json) question.options.emplace_back("--json");
  return print_answer(
      options.connection, question,
      options.format == OutputFormat::json ? AnswerText::lines : AnswerText::tables);
}

/// Prints the tables of a campaign, finished or not; of requirements, if there are any, the answers
/// instead. JSON holds both.
int print_report(const ReportOptions& options) {
  if (is_remote(options.connection)) return print_remote_report(options);
  const Store store = Store::open_read_only(options.database);
  const std::shared_ptr<const Campaign> campaign = stored_campaign(store);
  const std::vector<RequirementAnswer> answers = answers_of(store, *campaign, options.requirements);
  if (options.format == OutputFormat::json) {
    print_lines(report_json(store, *campaign, answers));
  } else {
    print_tables(answers.empty() ? report_text(store, *campaign) : answers_text(answers));
  }
  const bool are_met = std::ranges::all_of(answers, [](const RequirementAnswer& answer) {
    return answer.check.verdict == Verdict::met;
  });
  return are_met ? exit_done : exit_not_met;
}

}  // namespace

void add_report(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<ReportOptions>(
      app, chosen, "report", "Print the tables of a database", print_report);
  command.footer(exit_codes_text({exit_not_met}));
  add_database(command, options.database);
  command.add_option("--requirement", options.requirements,
                     "Answer whether this requirement is met, as in\n"
                     "\"a_c12 < 9e-4 for 99% with 95%\" or\n"
                     "\"all objectives for 95% with 90%\"; may be repeated");
  add_json_flag(command, options.format);
  add_optional_connection(command, options.connection);
}

}  // namespace proofmass::coordinator
