#include "coordinator/cli/export_command.hpp"

#include <fmt/format.h>

#include <csignal>

#include "coordinator/archive/export.hpp"
#include "coordinator/cli/archive_stop.hpp"
#include "coordinator/cli/exit_code.hpp"
#include "coordinator/store/store.hpp"

namespace proofmass::coordinator {
namespace {

void check(const ExportOptions& options) {
  if (options.output.empty()) {
    if (options.format != ExportFormat::hdf5) return;
    throw UsageError("output = - (must be a file for hdf5: name it with --output)");
  }
  if (!options.is_forced && std::filesystem::exists(options.output)) {
    throw UsageError(fmt::format("output = {} (exists already; replace it with --force)",
                                 options.output.string()));
  }
}

void write_text(const ExportOptions& options, const Store& store, TextOutput& output,
                const IsStopped& is_stopped) {
  if (options.format == ExportFormat::csv) {
    export_csv(store, output, is_stopped);
  } else {
    export_json(store, output, is_stopped);
  }
}

void write(const ExportOptions& options, const IsStopped& is_stopped) {
  const Store store = Store::open_read_only(options.database);
  if (options.format == ExportFormat::hdf5) {
    export_hdf5(store, options.output, is_stopped);
  } else if (options.output.empty()) {
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
