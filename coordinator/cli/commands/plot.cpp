#include <fmt/format.h>
#include <sys/wait.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "coordinator/archive/replay.hpp"
#include "coordinator/archive/stored_campaign.hpp"
#include "coordinator/charts/chart.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/output.hpp"
#include "coordinator/cli/program.hpp"
#include "coordinator/report/review_charts.hpp"
#include "coordinator/store/store.hpp"
#include "core/model.hpp"
#include "proto/command_line/option_checks.hpp"
#include "proto/link/machine.hpp"
#include "proto/link/whole_file.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
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
  if (options.output.empty()) throw UsageError("output = (must be given)");
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
  svg.write(svg_of(picture, SvgUse::plain));
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
  write_document(options.output, options.if_there, svg_of(picture, SvgUse::standalone));
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
                 const IsStopped& is_stopped) {
  review.spectra = worst_run_spectra(store, review, is_stopped);
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
  const bool are_causes_needed = options.is_list || needs_causes(options.chart);
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
  return run_until_stopped([&](const IsStopped& is_stopped) {
    add_spectra(store, options.chart, review, is_stopped);
    return write();
  });
}

}  // namespace

void add_plot(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<PlotOptions>(
      app, chosen, "plot", "Draw a chart of the review report as a picture", plot);
  command.footer(exit_codes_text({exit_interrupted}));
  add_database(command, options.database);
  command.add_option("--chart", options.chart,
                     fmt::format("Which one, as in errors or histogram:{};\nsee --list",
                                 example_quantity(example_results()).name));
  command
      .add_option("--output", options.output,
                  "File .svg, or .png by rsvg-convert; - for SVG on\nstandard output")
      ->type_name(wire::file_type);
  command.add_flag("--list", options.is_list, "Print the names of all charts");
  add_force_flag(command, options.if_there);
}

}  // namespace proofmass::coordinator
