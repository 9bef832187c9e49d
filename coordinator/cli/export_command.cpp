#include "coordinator/cli/export_command.hpp"

#include <fmt/format.h>

#include <csignal>
#include <string_view>
#include <system_error>

#include "coordinator/archive/campaign_mark.hpp"
#include "coordinator/archive/export.hpp"
#include "coordinator/cli/archive_stop.hpp"
#include "coordinator/cli/exit_code.hpp"
#include "coordinator/store/store.hpp"

namespace proofmass::coordinator {
namespace {

bool is_standard_output(const std::filesystem::path& output) {
  return output.empty() || output == "-";
}

[[noreturn]] void refuse(const std::filesystem::path& output, std::string_view why) {
  throw UsageError(fmt::format("output = {} ({})", output.string(), why));
}

// The output takes the place of what has its name: a device or a campaign would be lost.
void check(const ExportOptions& options) {
  const std::filesystem::path& output = options.output;
  if (is_standard_output(output)) {
    if (options.format != ExportFormat::hdf5) return;
    refuse("-", "must be a file for hdf5: name it with --output");
  }
  std::error_code ignored;
  if (!std::filesystem::exists(output, ignored)) return;
  if (!options.is_forced) refuse(output, "exists already; replace it with --force");
  if (!std::filesystem::is_regular_file(output)) {
    refuse(output, "is no file; leave --output out to write to a pipe or device");
  }
  if (has_campaign_mark(output)) refuse(output, "is a campaign, which --force does not replace");
}

void write_text(const ExportOptions& options, const Store& store, TextOutput& output,
                const IsStopped& is_stopped) {
  if (options.format == ExportFormat::csv) {
    export_csv(store, output, is_stopped, options.draws);
  } else {
    export_json(store, output, is_stopped, options.draws);
  }
}

void write(const ExportOptions& options, const IsStopped& is_stopped) {
  const Store store = Store::open_read_only(options.database);
  if (options.format == ExportFormat::hdf5) {
    export_hdf5(store, options.output, is_stopped, options.draws);
  } else if (is_standard_output(options.output)) {
    TextOutput output;
    write_text(options, store, output, is_stopped);
  } else {
    TextOutput output(options.output);
    write_text(options, store, output, is_stopped);
  }
}

}  // namespace

int export_results(const ExportOptions& options) {
  check(options);
  std::signal(SIGPIPE, SIG_IGN);  // A reader that goes away is an error like any other.
  return run_until_stopped([&](const IsStopped& is_stopped) {
    write(options, is_stopped);
    return exit_done;
  });
}

}  // namespace proofmass::coordinator
