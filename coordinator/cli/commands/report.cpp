#include "coordinator/report/report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "coordinator/archive/replay.hpp"
#include "coordinator/archive/stored_campaign.hpp"
#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/cli/client.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/output.hpp"
#include "coordinator/cli/program.hpp"
#include "coordinator/report/requirements.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/campaign.hpp"
#include "proto/command_line/option_checks.hpp"
#include "proto/link/machine.hpp"
#include "proto/link/whole_file.hpp"

namespace proofmass::coordinator {
namespace {

struct ReportOptions {
  std::filesystem::path database;
  std::vector<std::string> requirements;    ///< See parse_requirement().
  std::filesystem::path requirements_file;  ///< Empty: there is none.
  OutputFormat format = OutputFormat::text;
  std::filesystem::path html;      ///< `-` is standard output; not written if empty.
  std::filesystem::path markdown;  ///< `-` is standard output; not written if empty.
  wire::IfThere if_there = wire::IfThere::keep;
  ClientConnectionConfig connection;  ///< Of a coordinator, if it is to be asked.

  [[nodiscard]] bool has_document() const { return !html.empty() || !markdown.empty(); }
};

std::vector<StatedRequirement> stated_in(const ReportOptions& options,
                                         const ResultSchema& results) {
  if (options.requirements_file.empty()) return numbered_requirements(options.requirements);
  if (!options.requirements.empty()) {
    throw UsageError("requirement = " + options.requirements.front() +
                     " (must not be given with --requirements)");
  }
  return read_requirements(options.requirements_file, results);
}

std::string answers_text(const Review& review, const std::vector<StatedRequirement>& stated,
                         Paint paint) {
  std::string text;
  for (const StatedRequirement& each : stated) {
    text += (text.empty() ? "" : "\n") + requirement_text(answer_to(each, review), paint);
  }
  return text + (review.note.empty() ? "" : "\n") + note_text(review.note);
}

int print_remote_report(const ReportOptions& options) {
  if (options.has_document() || !options.requirements_file.empty()) {
    throw UsageError("connect = " + options.connection.endpoint +
                     " (must not be given with --html, --markdown and --requirements; fetch the "
                     "database first)");
  }
  proto::RequestEnvelope question = question_about(options.database, proto::QUESTION_REPORT);
  for (const std::string& requirement : options.requirements) {
    question.mutable_answer()->add_options("--requirement=" + requirement);
  }
  if (options.format == OutputFormat::json) question.mutable_answer()->add_options("--json");
  return print_answer(options.connection, question, AnswerText::lines);
}

int exit_code_of(const Review& review, const std::vector<StatedRequirement>& stated) {
  const bool are_met = std::ranges::all_of(stated, [&](const StatedRequirement& each) {
    return answer_to(each, review).check.verdict == RequirementVerdict::met &&
           review.num_contradicting == 0;
  });
  return are_met ? exit_done : exit_not_met;
}

/// Two texts in one stream would be neither.
void check_standard_output(const ReportOptions& options) {
  std::string_view taker = options.format == OutputFormat::json ? "--json" : "";
  const auto take = [&](const std::filesystem::path& file, std::string_view option) {
    if (file != "-") return;
    if (!taker.empty()) {
      throw UsageError(
          fmt::format("{} = - (standard output is already taken by {})", option.substr(2), taker));
    }
    taker = option;
  };
  take(options.html, "--html");
  take(options.markdown, "--markdown");
}

/// For a shell in the directory of the database, whose name alone is in the document.
std::string requirement_options(const ReportOptions& options) {
  std::string text;
  for (const std::string& requirement : options.requirements) {
    text += " --requirement " + wire::shell_word(requirement);
  }
  if (options.requirements_file.empty()) return text;
  const std::filesystem::path file =
      std::filesystem::proximate(options.requirements_file, wire::directory_of(options.database));
  return text + " --requirements " + wire::shell_word(file.string());
}

/// @return What print_report() returns.
int write_documents(const ReportOptions& options, const Store& store,
                    const std::vector<StatedRequirement>& stated, Review& review) {
  review.options = requirement_options(options);
  const auto write = [&] {
    if (!options.html.empty()) write_document(options.html, options.if_there, review_html(review));
    if (!options.markdown.empty()) {
      write_document(options.markdown, options.if_there, review_markdown(review));
    }
    return exit_code_of(review, stated);
  };
  if (options.html.empty()) return write();
  return run_until_stopped([&](const IsStopped& is_stopped) {
    review.spectra = worst_run_spectra(store, review, is_stopped);
    return write();
  });
}

ReviewDepth depth_of(const ReportOptions& options, const std::vector<StatedRequirement>& stated) {
  if (options.has_document()) return ReviewDepth::causes;
  const bool has_answers = options.format == OutputFormat::json || !stated.empty();
  return has_answers ? ReviewDepth::matrix : ReviewDepth::tables;
}

/// Prints the tables of a campaign, finished or not; of requirements, if there are any, the answers
/// instead. JSON holds both. A document takes the place of the text.
int print_report(const ReportOptions& options) {
  if (is_remote(options.connection, options.database)) return print_remote_report(options);
  check_standard_output(options);
  check_document(options.html, options.if_there);
  check_document(options.markdown, options.if_there);
  const Store store = Store::open_read_only(options.database);
  const std::vector<StatedRequirement> stated = stated_in(options, store.schema());
  const std::shared_ptr<const Campaign> campaign = stored_campaign(store);
  const bool is_json = options.format == OutputFormat::json;
  Review review = read_review(store, *campaign, depth_of(options, stated), stated);
  review.database = options.database.filename().string();
  if (options.has_document()) {
    const int exit_code = write_documents(options, store, stated, review);
    if (!is_json || exit_code == exit_interrupted) return exit_code;
  }
  const Paint paint = style_of(stdout).paint;
  if (is_json) {
    print_json(report_json(review, stated));
  } else {
    write_standard_output(stated.empty() ? report_text(review, paint)
                                         : answers_text(review, stated, paint));
  }
  return exit_code_of(review, stated);
}

}  // namespace

void add_report(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<ReportOptions>(
      app, chosen, "report", "Print the tables of a database", print_report);
  command.footer(exit_codes_text({exit_not_met, exit_interrupted}));
  add_database(command, options.database);
  command.add_option("--requirement", options.requirements,
                     fmt::format("Answer whether this requirement is met, as in\n\"{}\" or\n"
                                 "\"all objectives for 95% with 90%\"; may be repeated",
                                 example_requirement()));
  command
      .add_option("--requirements", options.requirements_file,
                  "File (TOML) of requirements, each with id, text\nand requirement")
      ->type_name(wire::file_type);
  command
      .add_option("--html", options.html,
                  "Write a report for a review, with charts, as\n"
                  "one HTML file; - for standard output")
      ->type_name(wire::file_type);
  command
      .add_option("--markdown", options.markdown,
                  "The same without charts, as Markdown; - for\nstandard output")
      ->type_name(wire::file_type);
  add_force_flag(command, options.if_there);
  add_json_flag(command, options.format);
  add_optional_connection(command, options.connection);
}

}  // namespace proofmass::coordinator
