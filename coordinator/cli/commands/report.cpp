#include "coordinator/report/report.hpp"

#include <fmt/format.h>
#include <sys/wait.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "coordinator/archive/replay.hpp"
#include "coordinator/archive/stored_campaign.hpp"
#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/charts/chart.hpp"
#include "coordinator/cli/client.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/program.hpp"
#include "coordinator/report/requirements.hpp"
#include "coordinator/report/sensitivity.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/campaign.hpp"
#include "core/campaign/independence.hpp"
#include "core/model.hpp"
#include "core/runs.hpp"
#include "core/statistics/sensitivity.hpp"
#include "proto/command_line/option_checks.hpp"
#include "proto/link/machine.hpp"
#include "proto/link/whole_file.hpp"
#include "proto/text/visible_text.hpp"

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
  return print_answer(options.connection, question);
}

int exit_code_of(const Review& review, const std::vector<StatedRequirement>& stated) {
  const bool are_met = std::ranges::all_of(stated, [&](const StatedRequirement& each) {
    return answer_to(each, review).check.verdict == RequirementVerdict::met;
  });
  return are_met && review.num_contradicting == 0 ? exit_done : exit_not_met;
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
  return run_until_stopped([&](const HeedStop& heed_stop) {
    review.spectra = worst_run_spectra(store, review, heed_stop);
    return write();
  });
}

/// Prints the tables of a campaign, finished or not; of requirements, if there are any, the answers
/// instead. JSON holds both. A document takes the place of the text.
int print_report(const ReportOptions& options) {
  if (is_remote(options.connection, options.database)) return print_remote_report(options);
  check_standard_output(options);
  for (const std::filesystem::path& document : {options.html, options.markdown}) {
    check_document(document, options.if_there);
    check_no_input(document, {options.requirements_file});
  }
  const Store store = Store::open_read_only(options.database);
  const std::vector<StatedRequirement> stated = stated_in(options, store.schema());
  const std::shared_ptr<const Campaign> campaign = stored_campaign(store);
  const bool is_json = options.format == OutputFormat::json;
  Review review = read_review(
      store, *campaign, options.has_document() ? ReviewDepth::causes : ReviewDepth::matrix, stated);
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
  add_path(command, wire::file_type, "--requirements", options.requirements_file,
           "File (TOML) of requirements, each with id, text\nand requirement");
  add_path(command, wire::file_type, "--html", options.html,
           "Write a report for a review, with charts, as\n"
           "one HTML file; - for standard output");
  add_path(command, wire::file_type, "--markdown", options.markdown,
           "The same without charts, as Markdown; - for\nstandard output");
  add_force_flag(command, options.if_there);
  add_json_flag(command, options.format);
  add_optional_connection(command, options.connection);
}

namespace {

struct PlotOptions {
  std::filesystem::path database;
  std::string chart;
  std::filesystem::path output;
  bool is_list = false;
  wire::IfThere if_there = wire::IfThere::keep;
};

bool is_png(const std::filesystem::path& output) { return output.extension() == ".png"; }

void check_plot_arguments(const PlotOptions& options) {
  if (options.is_list) return;
  if (options.chart.empty()) throw UsageError("chart = (must be given; --list names all)");
  if (options.output.empty()) throw UsageError("output = (must be given, as --output FILE.svg)");
  const bool is_picture = options.output.extension() == ".svg" || is_png(options.output);
  if (options.output != "-" && !is_picture) {
    refuse_output(options.output, "must end in .svg or .png, or be - for SVG on standard output");
  }
  check_document(options.output, options.if_there);
}

const Picture& chosen_picture(const std::vector<NamedPicture>& pictures, const std::string& name) {
  const auto found = std::ranges::find(pictures, name, &NamedPicture::name);
  if (found != pictures.end()) return found->picture;
  throw UsageError(fmt::format("this campaign has no chart {}; --list names those that it has",
                               wire::visible_text(name)));
}

pid_t start_converter(const std::filesystem::path& svg, const std::filesystem::path& png,
                      const std::filesystem::path& output) {
  constexpr std::string_view width = "1200";  // Pixels: twice the width of a column of a page.
  try {
    return wire::start_program(
        {.arguments = {"rsvg-convert", "--width", std::string(width), "--keep-aspect-ratio",
                       "--format", "png", "--output", png.string(), svg.string()}});
  } catch (const Error&) {
    refuse_output(output,
                  "rsvg-convert is not installed; install the package librsvg2-bin, or write .svg");
  }
}

/// Writes a bitmap of the picture. The file appears when it is whole.
void write_png(const Picture& picture, const PlotOptions& options) {
  const wire::DraftFile svg("output", options.output, wire::private_mode, ".svg-draft");
  wire::DraftFile png("output", options.output);
  svg.write(svg_of(picture, SvgUse::file));
  const int status = wire::wait_for_end(start_converter(svg.draft(), png.draft(), options.output));
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) {
    throw Error(fmt::format("output = {} (rsvg-convert failed)", options.output.string()));
  }
  png.publish(options.if_there);
}

void write_picture(const Picture& picture, const PlotOptions& options) {
  if (is_png(options.output)) {
    write_png(picture, options);
    return;
  }
  write_document(options.output, options.if_there, svg_of(picture, SvgUse::file));
}

/// Of what can be simulated here.
std::vector<std::string> spectrum_names_of(const Campaign& campaign) {
  if (!campaign.model().can_simulate()) return {};
  return spectrum_names(campaign.prepare()->recording());
}

/// The spectra are not computed: to tell their names, no run has to be simulated.
void print_names(const Review& review, const Campaign& campaign) {
  std::string names;
  for (const NamedPicture& named : review_pictures(review)) names += named.name + "\n";
  for (const std::string& name : spectrum_names_of(campaign)) {
    names += name + "\n";
  }
  print_lines(names);
}

/// The spectra of the worst run, which is simulated for them.
/// @throws ArchiveError if it has no spectrum of that name.
void add_spectra(const Store& store, const std::string& chart, Review& review,
                 const HeedStop& heed_stop) {
  review.spectra = worst_run_spectra(store, review, heed_stop);
  const RunSpectra& spectra = *review.spectra;
  if (std::ranges::any_of(spectra.sessions, [&](const SessionSpectrum& spectrum) {
        return spectrum_name(spectrum.session) == chart;
      })) {
    return;
  }
  throw ArchiveError(
      fmt::format("chart = {} ({})", wire::visible_text(chart), fmt::join(spectra.reasons, " ")));
}

int plot(const PlotOptions& options) {
  check_plot_arguments(options);
  const Store store = Store::open_read_only(options.database);
  const std::shared_ptr<const Campaign> campaign = stored_campaign(store);
  const bool are_causes_needed = options.is_list || options.chart == "causes";
  Review review =
      read_review(store, *campaign, are_causes_needed ? ReviewDepth::causes : ReviewDepth::charts);
  if (options.is_list) {
    print_names(review, *campaign);
    return exit_done;
  }
  const auto write = [&] {
    write_picture(chosen_picture(review_pictures(review), options.chart), options);
    return exit_done;
  };
  const std::vector<std::string> spectra = spectrum_names_of(*campaign);
  if (std::ranges::find(spectra, options.chart) == spectra.end()) return write();
  return run_until_stopped([&](const HeedStop& heed_stop) {
    add_spectra(store, options.chart, review, heed_stop);
    return write();
  });
}

}  // namespace

void add_plot(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<PlotOptions>(
      app, chosen, "plot", "Draw a chart of the review report as a picture", plot);
  command.footer(exit_codes_text({exit_interrupted}));
  add_database(command, options.database);
  command.add_option(
      "--chart", options.chart,
      fmt::format("Which one, as in errors or histogram:{};\nsee --list; needed without it",
                  example_quantity(example_results()).name));
  add_path(
      command, wire::file_type, "--output", options.output,
      "File .svg, or .png by rsvg-convert; - for SVG on\nstandard output; needed without --list");
  command.add_flag("--list", options.is_list, "Print the names of all charts");
  add_force_flag(command, options.if_there);
}

namespace {

/// More than any model draws and estimates.
constexpr std::size_t num_rows_max = 2000;

struct SensitivityOptions {
  std::filesystem::path database;
  std::optional<std::string> parameter;  ///< Name; all by default.
  std::optional<std::uint64_t> run;      ///< To be explained.
  std::optional<std::size_t> num_rows;   ///< Drawn quantities that are named for each error.
  OutputFormat format = OutputFormat::text;
  ClientConnectionConfig connection;  ///< Of a coordinator, if it is to be asked.
};

std::size_t quantity_named(std::string_view name, const ResultSchema& schema) {
  if (const std::optional<std::size_t> found = find_quantity(schema, name)) return *found;
  throw UsageError(fmt::format("parameter = {} (must be one of {})", name,
                               fmt::join(quantity_names(schema), " ")));
}

int print_remote_sensitivity(const SensitivityOptions& options) {
  proto::RequestEnvelope question = question_about(options.database, proto::QUESTION_SENSITIVITY);
  proto::AnswerRequest& asked = *question.mutable_answer();
  if (options.num_rows) asked.add_options(fmt::format("--rows={}", *options.num_rows));
  if (options.parameter) asked.add_options("--parameter=" + *options.parameter);
  if (options.run) asked.add_options(fmt::format("--run={}", *options.run));
  if (options.format == OutputFormat::json) asked.add_options("--json");
  return print_answer(options.connection, question);
}

int print_sensitivity(const SensitivityOptions& options) {
  if (is_remote(options.connection, options.database)) return print_remote_sensitivity(options);
  const Store store = Store::open_read_only(options.database);
  std::vector<std::size_t> quantities;
  if (options.parameter) quantities.push_back(quantity_named(*options.parameter, store.schema()));
  std::optional<RunIndex> explained;
  if (options.run) explained = RunIndex{*options.run};
  const std::shared_ptr<const Campaign> campaign = stored_campaign(store);
  require_independent(*campaign, "campaign", campaign->name);
  const DrawnRuns drawn = read_drawn_runs(store, *campaign, sensitivity_runs_max, explained);
  if (drawn.runs.size() < sensitivity_values_min) {
    throw Error(fmt::format("runs with an estimate = {} (sensitivities need {} at least)",
                            drawn.runs.size(), sensitivity_values_min));
  }
  const bool is_json = options.format == OutputFormat::json;
  if (explained && quantities.empty()) {
    const std::vector<double> objectives = campaign->objectives();
    if (!is_json) print_lines(choice_text(drawn, *explained, objectives));
    quantities.push_back(worst_quantity_of(drawn, *explained, objectives));
  }
  if (quantities.empty()) {
    for (std::size_t i = 0; i < drawn.errors.size(); ++i) quantities.push_back(i);
  }
  if (is_json) {
    print_json(sensitivity_json(drawn, quantities, explained, options.num_rows));
    return exit_done;
  }
  const Paint paint = style_of(stdout).paint;
  std::string_view separator = "";
  std::vector<std::size_t> unexplained;
  const auto write = [&](const std::string& text) {
    write_standard_output(fmt::format("{}{}", separator, text));
    separator = "\n";
  };
  for (const std::size_t quantity : quantities) {
    const std::string text = sensitivity_text(drawn, quantity, explained, options.num_rows, paint);
    if (text.empty()) {
      unexplained.push_back(quantity);
    } else {
      write(text);
    }
  }
  if (!unexplained.empty()) write(unexplained_text(drawn, unexplained));
  return exit_done;
}

}  // namespace

void add_sensitivity(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<SensitivityOptions>(
      app, chosen, "sensitivity", "Print which drawn quantities drive the errors",
      print_sensitivity);
  add_database(command, options.database);
  command.add_option("--parameter", options.parameter,
                     "Parameter; all by default, or with --run the one\n"
                     "with the largest error beside its objective");
  add_number(command, "--run", options.run, {0, num_runs_max - 1}, "Explain the error of this run");
  add_number(command, "--rows", options.num_rows, {1, num_rows_max},
             "Quantities to name for each error; by default 5,\n"
             "or none if chance explains all influences");
  add_json_flag(command, options.format);
  add_optional_connection(command, options.connection);
}

}  // namespace proofmass::coordinator
